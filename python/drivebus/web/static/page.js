// Every page: what the plant says is put in its place once a second, and ages run on by this computer's own clock. When
// nothing comes any more, all is old within three seconds. Stops go out at one touch.
"use strict";

const LOST = 3, MOST_EVENTS = 200;
// Milliseconds. A drive that is silent is told to stop for ten seconds before it is given up.
const SIGN = 5000, ORDER = 20000;
const page = { plant: null, came: performance.now(), clock: Date.now(), source: null, ended: "" };
const token = document.body.dataset.token;

// The clock of the plant's computer, in seconds. Two clocks of ours: one stands while a computer sleeps, one may be set.
function since() {
  return Math.max(performance.now() - page.came, Date.now() - page.clock, 0) / 1000;
}
// Before the first picture, what the server wrote is as old as the page.
const now = () => (page.plant?.time ?? Number(document.body.dataset.seen)) + since();

function ago(seconds) {
  if (seconds < 10) return `${Math.max(seconds, 0).toFixed(1)} s`;
  if (seconds < 120) return `${Math.round(seconds)} s`;
  return seconds < 7200 ? `${Math.round(seconds / 60)} min` : `${Math.round(seconds / 3600)} h`;
}

function clock(date) {
  const two = (number) => String(number).padStart(2, "0");
  const day = `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())}`;
  return `${day} ${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}`;
}

function put(root, of, text, hides) {
  const place = root.querySelector(`[data-of="${of}"]`);
  if (!place) return;
  if (place.textContent !== text) place.textContent = text;
  if (hides) place.hidden = !text;
}

function showLine(line) {
  for (const root of document.querySelectorAll(`section[data-line="${CSS.escape(line.name)}"]`)) {
    put(root, "open", line.open ? "open" : `AWAY: ${line.why}`);
    put(root, "share", line.share ? `${line.share} of its time used` : "");
    put(root, "asked", `${line.requests} requests, ${line.timeouts} without an answer`);
    put(root, "late", line.late.length ? `late or gone: ${line.late.join(", ")}` : "");
    const hints = root.querySelector('[data-of="hints"]');
    hints.replaceChildren(...line.hints.map((hint) => Object.assign(document.createElement("li"), { textContent: hint })));
  }
}

function showDrive(drive) {
  for (const root of document.querySelectorAll(`[data-drive="${CSS.escape(drive.name)}"]`)) {
    root.classList.toggle("faulty", Boolean(drive.fault));
    put(root, "speed", drive.speed || "–");
    const silent = drive.quality === "gone" || drive.quality === "unknown";
    put(root, "state", drive.state || (silent ? "" : "no word for its state"));
    put(root, "fault", drive.fault ? `Fault: ${drive.fault}` : "", true);
    put(root, "missing", drive.missing, true);
    put(root, "by", drive.by ? `set in motion by ${drive.by}` : "", true);
    const mark = root.querySelector('[data-of="quality"]');
    mark.dataset.time = drive.time ?? "";
    mark.dataset.limit = drive.limit;
    mark.dataset.quality = drive.quality;
  }
  const table = document.querySelector(`[data-values="${CSS.escape(drive.name)}"]`);
  if (table) showValues(table, drive.values);
}

function showValues(table, values) {
  const rows = new Map([...table.rows].map((row) => [row.dataset.value, row]));
  const wanted = new Set(values.map((each) => each.name));
  for (const [name, row] of rows) if (!wanted.has(name)) row.remove();
  for (const each of values) {
    let row = rows.get(each.name);
    if (!row) {
      row = table.insertRow();
      row.dataset.value = each.name;
      const head = Object.assign(document.createElement("th"), { scope: "row", textContent: each.name });
      row.append(head, ...["number value", "", "old-at"].map((name) => Object.assign(document.createElement("td"), { className: name })));
    }
    if (row.cells[1].textContent !== each.text) row.cells[1].textContent = each.text;
    row.cells[2].textContent = each.unit;
    row.cells[3].dataset.time = each.time;
    row.cells[3].dataset.limit = each.limit;
  }
}

// What happened since the page was made comes before what it has.
function showEvents(events) {
  for (const table of document.querySelectorAll("tbody[data-events]")) {
    // One that happened before others may come behind them.
    const subject = table.dataset.events, mark = (at, text) => `${at} ${text}`;
    const known = new Set([...table.rows].map((row) => mark(row.dataset.at, row.lastElementChild.textContent)));
    const fresh = events.filter((each) => (!subject || each.subject === subject) && !known.has(mark(each.time, each.text)));
    if (!fresh.length) continue;
    table.querySelector(".none")?.remove();
    table.prepend(...fresh.map((each) => {
      const row = document.createElement("tr");
      row.className = each.kind;
      row.dataset.at = each.time;
      const texts = [clock(new Date(each.time * 1000)), ...(subject ? [] : [each.subject]), each.text];
      for (const text of texts) row.insertCell().textContent = text;
      return row;
    }));
    while (table.rows.length > MOST_EVENTS) table.deleteRow(-1);
  }
}

// A time that lies ahead was told by a clock that was set since: how old it is, nobody knows.
const isOld = (age, place) => age > Number(place.dataset.limit) || age < -LOST;

// What is old says so, whatever it was when it came.
function age() {
  const moment = now(), lost = since() > LOST;
  document.body.classList.toggle("lost", lost);
  const banner = document.getElementById("lost");
  banner.hidden = !(lost || page.ended);
  const told = `No word from the service for ${ago(since())}: all values here are old, and nothing can be ordered.`;
  banner.textContent = page.ended || told;
  for (const mark of document.querySelectorAll('[data-of="quality"]')) ageDrive(mark, moment, lost);
  for (const cell of document.querySelectorAll(".old-at")) {
    const gone = moment - Number(cell.dataset.time), old = lost || isOld(gone, cell);
    const text = `${ago(gone)}${old ? ", OLD" : ""}`;
    if (cell.textContent !== text) cell.textContent = text;
    cell.classList.toggle("old", old);
    cell.parentElement.cells[1].classList.toggle("old", old);
  }
}

function ageDrive(mark, moment, lost) {
  const known = Boolean(mark.dataset.time), gone = moment - Number(mark.dataset.time);
  let quality = mark.dataset.quality;
  if (quality === "good" || quality === "old") quality = lost || isOld(gone, mark) ? "old" : "good";
  const words = { good: `${ago(gone)} ago`, old: `OLD: ${ago(gone)} ago`, unknown: "NOT KNOWN", gone: known ? `GONE, asked ${ago(gone)} ago` : "GONE" };
  if (mark.textContent !== words[quality]) mark.textContent = words[quality];
  mark.className = `quality ${quality}`;
  const root = mark.closest("[data-drive]");
  for (const each of Object.keys(words)) root.classList.toggle(each, each === quality);
}

function show(plant) {
  page.plant = plant;
  page.came = performance.now();
  page.clock = Date.now();
  for (const line of plant.lines) showLine(line);
  for (const drive of plant.drives) showDrive(drive);
  showEvents(plant.events);
  age();
  // Who set a motor in motion says that somebody is here, as long as the plant is heard of.
  if (answers()) send("/here", {}, SIGN).catch(() => {});
}

const answers = () => page.plant !== null && page.plant.drives.some((drive) => drive.by === document.body.dataset.person);

function listen() {
  if (page.source || page.ended) return;
  page.source = new EventSource("/live");
  page.source.onmessage = (event) => show(JSON.parse(event.data));
  page.source.addEventListener("enough", () => {
    quiet();
    page.ended = "This page stands still, for others of yours are open. Click here, or come back to it, to go on.";
    age();
  });
  page.source.addEventListener("out", () => location.assign("/login"));
  page.source.onerror = () => {
    // A browser tries again by itself where a connection broke; not where it was refused.
    if (page.source && page.source.readyState === EventSource.CLOSED) {
      quiet();
      setTimeout(retry, 1000);
    }
  };
}

async function retry() {
  const answer = await fetch("/", { headers: { accept: "application/json" }, redirect: "manual" }).catch(() => null);
  if (answer && answer.status === 401) location.assign("/login");
  else if (document.visibilityState === "visible" || answers()) listen();
}

function quiet() {
  if (page.source) page.source.close();
  page.source = null;
}

function back() {
  page.ended = "";
  listen();
}

async function send(address, fields, patience) {
  const body = new URLSearchParams({ ...fields, form_token: token });
  const options = { method: "POST", body, headers: { accept: "application/json" }, signal: AbortSignal.timeout(patience) };
  const answer = await fetch(address, options);
  if (answer.status === 401) location.assign("/login");
  return answer;
}

function tell(text, kind) {
  const list = document.getElementById("told");
  const item = Object.assign(document.createElement("li"), { className: kind });
  const close = Object.assign(document.createElement("button"), { type: "button", textContent: "Close", onclick: () => item.remove() });
  item.append(Object.assign(document.createElement("span"), { textContent: text }), close);
  list.prepend(item);
  while (list.children.length > 5) list.lastChild.remove();
  if (kind === "done") setTimeout(() => item.remove(), 20000);
  return item;
}

// Gives an order and says what became of it; whether all was done.
async function order(fields) {
  const what = `${fields.drive ?? "all drives"}: ${fields.what.replace("_", " ")}`;
  let answer;
  try {
    answer = await send("/order", fields, ORDER);
    if (!answer.headers.get("content-type")?.includes("json")) throw new Error((await answer.text()).trim() || `status ${answer.status}`);
    const results = await answer.json();
    if (!results.length) tell(`${what}: there is no drive that could be stopped`, "wrong");
    for (const each of results) {
      const words = [each.drive, each.what, each.result, each.text].filter(Boolean).join(": ");
      tell(words, each.result === "done" ? "done" : "wrong");
    }
    return answer.ok;
  } catch (error) {
    const why = error instanceof TypeError || error.name === "TimeoutError" ? "the service does not answer" : error.message;
    tell(`${what}: NOT KNOWN whether it was done: ${why}. If it must stop, use the emergency stop.`, "wrong");
    return false;
  }
}

document.addEventListener("submit", (event) => {
  const form = event.target.closest("form.order");
  if (!form) return;
  event.preventDefault();
  const fields = Object.fromEntries(new FormData(form));
  fields.what = event.submitter?.value ?? form.querySelector("[name=what]").value;
  const sent = tell(`${fields.drive ?? "all drives"}: ${fields.what.replace("_", " ")}: sent`, "sent");
  order(fields).finally(() => sent.remove());
});

document.addEventListener("visibilitychange", () => {
  if (document.visibilityState === "visible") back();
  // A hidden page takes one of a browser's few connections; one that answers for a motor stays.
  else if (!answers()) quiet();
});
document.getElementById("lost").addEventListener("click", back);
for (const time of document.querySelectorAll("time[datetime]")) time.textContent = clock(new Date(time.dateTime));
setInterval(age, 250);
listen();
