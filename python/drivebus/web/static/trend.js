// The curves of a drive: one or two of its values over the last hours, with gaps where nothing is known.
"use strict";

(() => {
  const root = document.getElementById("trend"), drive = root.dataset.driveName;
  const choice = root.querySelector(".choice"), told = document.getElementById("trend-told"), curves = document.getElementById("curves");
  const boxes = ["trend-value", "trend-other"].map((id) => document.getElementById(id)), hours = document.getElementById("trend-hours");
  // Milliseconds, for each hour that is shown.
  const EVERY = 30000;
  // Its legend comes with a style within, which our pages do not allow, and we say the values ourselves.
  Dygraph.PLUGINS = Dygraph.PLUGINS.filter((each) => each !== Dygraph.Plugins.Legend);
  let known = "", asked = 0, drawn = 0;

  function units() {
    const now = page.plant?.drives.find((each) => each.name === drive);
    return new Map((now?.values ?? []).map((each) => [each.name, each.unit]));
  }

  // The values that can be chosen are those that the drive has, which come with the first picture.
  function fill() {
    const names = [...units().keys()];
    if (!names.length || names.join() === known) return;
    known = names.join();
    boxes.forEach((box, place) => {
      const before = box.value, some = place ? ["", ...names] : names;
      box.replaceChildren(...some.map((name) => new Option(name || "nothing more", name)));
      const usual = place ? "" : names.find((name) => units().get(name) === "Hz") ?? names[0];
      box.value = some.includes(before) && before ? before : usual;
    });
    choice.hidden = false;
    draw();
  }

  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function curve(name, unit, course) {
    const holder = Object.assign(document.createElement("div"), { className: "curve" });
    const title = Object.assign(document.createElement("h3"), { textContent: unit ? `${name} in ${unit}` : name });
    const picture = Object.assign(document.createElement("div"), { className: "picture" });
    const at = Object.assign(document.createElement("p"), { className: "at" });
    picture.setAttribute("role", "img");
    const values = course.points.map((point) => point[1]).filter((value) => value !== null);
    const about = values.length ? `from ${Math.min(...values)} to ${Math.max(...values)} ${unit}` : "no values";
    picture.setAttribute("aria-label", `${name} of ${drive}, last ${hours.value} h: ${about}`);
    at.textContent = about;
    holder.append(title, picture, at);
    curves.append(holder);
    if (!values.length) return;
    const rows = course.points.map(([time, value]) => [new Date(time), value]);
    new Dygraph(picture, rows, {
      labels: ["time", name], stepPlot: true, connectSeparatedPoints: false, color: colour("--curve"), strokeWidth: 2,
      dateWindow: [course.since, course.until], gridLineColor: colour("--grid"), axisLineColor: colour("--edge"), includeZero: true,
      highlightCallback: (_, x, points) => { at.textContent = `${clock(new Date(x))}: ${points.map((each) => each.yval).join()} ${unit}`; },
      unhighlightCallback: () => { at.textContent = about; },
    });
  }

  async function draw() {
    drawn = Date.now();
    const mine = ++asked, names = [...new Set(boxes.map((box) => box.value).filter(Boolean))], unit = units();
    told.textContent = "reading…";
    try {
      const courses = await Promise.all(names.map(async (name) => {
        const answer = await fetch(`/trend/${encodeURIComponent(drive)}?${new URLSearchParams({ value: name, hours: hours.value })}`);
        if (!answer.ok) throw new Error(`the service says ${answer.status}`);
        return answer.json();
      }));
      if (mine !== asked) return;
      curves.replaceChildren();
      names.forEach((name, place) => curve(name, unit.get(name) ?? "", courses[place]));
      told.textContent = `as of ${clock(new Date(Math.min(...courses.map((each) => each.until))))}`;
    } catch (error) {
      if (mine === asked) told.textContent = `No curves: ${error.message}`;
    }
  }

  for (const box of [...boxes, hours]) box.addEventListener("change", draw);
  const waiting = setInterval(fill, 250);
  setInterval(() => {
    if (known && document.visibilityState === "visible" && Date.now() - drawn >= EVERY * hours.value) draw();
  }, 5000);
  window.addEventListener("pagehide", () => clearInterval(waiting));
})();
