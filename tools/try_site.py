"""Opens the site of `make docs` in a real browser: no page is wider than the window, and searches find the right page.

Needs Chromium (Debian: `apt-get install chromium-headless-shell`, or `chromium`). One page of ours, beside the site's,
loads each page in a frame of a given width, and writes down what it saw.

usage: try_site.py [SITE]
"""

from __future__ import annotations

import functools
import html
import http.server
import json
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from urllib.parse import quote

SITE = Path(__file__).resolve().parent.parent / "target/site"
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
WIDTHS = (320, 1280)
SEARCHES = {
    "bias": "adapters.html",
    "E.oC": "errors.html",
    "2000H": "families/gd350.html",
    "stop": "safety.html",
    "Raspberry": "recipes.html",
}
"""What a technician would type, and the page that has to come first."""

PAGE = """<!doctype html><meta charset="utf-8"><title>trying</title><pre id="seen"></pre><script>
const asked = %s;
const frame = document.body.appendChild(document.createElement("iframe"));
frame.height = 800;
const loaded = (url) => new Promise((done) => { frame.onload = done; frame.src = url; });
const pause = (time) => new Promise((done) => setTimeout(done, time));
(async () => {
  const wide = [], hits = {};
  for (const width of asked.widths) {
    frame.width = width;
    for (const page of asked.pages) {
      await loaded(page);
      // `.content` is what scrolls in a narrow window; tables and blocks of code may do so by themselves.
      const parts = [...frame.contentDocument.querySelectorAll("html, .content")];
      if (parts.some((part) => part.scrollWidth > part.clientWidth)) wide.push(`${page} at ${width} px`);
    }
    for (const [word, url] of Object.entries(asked.searches)) {
      await loaded(url);
      const summary = () => frame.contentDocument.querySelector(".search-summary")?.textContent;
      for (let left = 100; left && !/found/.test(summary()); left--) await pause(50);
      const links = [...frame.contentDocument.querySelectorAll("#search-results li a")];
      hits[word] = links.slice(0, 3).map((link) => link.getAttribute("href").split("#")[0]);
    }
  }
  document.getElementById("seen").textContent = JSON.stringify({wide, hits});
  document.title = "tried";
})();
</script>
"""


class Handler(http.server.SimpleHTTPRequestHandler):
    """The site, and the page that tries it."""

    def do_GET(self) -> None:
        """One page or file."""
        if self.path != "/trying.html":
            super().do_GET()
            return
        root = Path(self.directory)
        pages = [path.relative_to(root).as_posix() for path in sorted(root.rglob("*.html"))]
        asked = {
            "widths": WIDTHS,
            "pages": [page for page in pages if not page.startswith(("rust/", "_"))],
            "searches": {word: f"search.html?q={quote(word)}" for word in SEARCHES},
        }
        body = (PAGE % json.dumps(asked)).encode()
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Says nothing."""


def main() -> int:
    """The command."""
    site = Path(sys.argv[1]) if len(sys.argv) > 1 else SITE
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        sys.exit("try_site.py: no browser: apt-get install chromium-headless-shell")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler, directory=str(site))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=600000", "--dump-dom"]
        address = f"http://127.0.0.1:{server.server_port}/trying.html"
        shown = subprocess.run([browser, *options, address], capture_output=True, text=True, timeout=480, check=True)
        server.shutdown()
    found = re.search(r'<pre id="seen">(\{.*?\})</pre>', shown.stdout, re.DOTALL)
    if found is None:
        sys.exit("try_site.py: the browser ended before it had seen every page")
    seen = json.loads(html.unescape(found[1]))
    wrong = [f"wider than the window: {page}" for page in seen["wide"]]
    for word, page in SEARCHES.items():
        hits = seen["hits"][word]
        print(f"{word}: {', '.join(hits)}")
        if hits[:1] != [page]:
            wrong.append(f"{word} does not lead to {page} first")
    for each in wrong:
        print(f"try_site.py: {each}", file=sys.stderr)
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
