// The page of one drive: what moves it is confirmed, with the drive, the direction and the speed said once more.
"use strict";

(() => {
  const box = document.querySelector(".orders"), dialog = document.getElementById("confirm");
  if (!box) return;
  box.hidden = false;
  const drive = box.dataset.for, hz = document.getElementById("hz"), stop = box.parentElement.querySelector("form.order");
  const stopAll = document.querySelector("header form.order"), header = stopAll.parentElement;
  let wanted = null;

  const words = (what, reverse, speed) => ({
    run: [`Run ${drive} ${reverse ? "in REVERSE" : "forward"} at ${speed} Hz?`, "The motor starts. Is the machine clear?", `Run ${reverse ? "in reverse" : "forward"}`],
    setpoint: [`Set the speed of ${drive} to ${speed} Hz?`, "A motor that runs changes its speed at once.", `Set ${speed} Hz`],
    reset: [`Reset the fault of ${drive}?`, "A drive that still has a command to run may start.", "Reset"],
    coast: [`Let ${drive} coast?`, "The drive lets go of the motor, which turns on by itself. Nothing brakes it.", "Coast"],
  })[what];

  box.addEventListener("click", (event) => {
    const button = event.target.closest("button[data-what]");
    if (!button) return;
    const what = button.dataset.what, needs = what === "run" || what === "setpoint";
    if (needs && !(hz.value !== "" && Number(hz.value) >= 0)) {
      tell("Give the speed in Hz first.", "wrong");
      hz.focus();
      return;
    }
    // What is sent is what was shown, whatever is typed meanwhile.
    wanted = { drive, what };
    if (needs) wanted.hz = hz.value;
    if (button.dataset.reverse) wanted.reverse = "1";
    const [title, more, yes] = words(what, wanted.reverse, wanted.hz);
    document.getElementById("confirm-what").textContent = title;
    document.getElementById("confirm-more").textContent = more;
    document.getElementById("confirm-yes").textContent = yes;
    // Behind an open dialog nothing can be pressed, so the stops come into it.
    dialog.append(stop, stopAll);
    dialog.returnValue = "no";
    dialog.showModal();
  });

  dialog.addEventListener("submit", (event) => {
    if (event.target !== dialog.firstElementChild) dialog.close("no");
  });

  dialog.addEventListener("close", () => {
    box.before(stop);
    header.prepend(stopAll);
    const chosen = wanted;
    wanted = null;
    if (dialog.returnValue !== "yes" || chosen === null) return;
    const random = crypto.getRandomValues(new Uint8Array(16));
    chosen.number = [...random].map((each) => each.toString(16).padStart(2, "0")).join("");
    // By the picture that was there when it was confirmed: a page that lost the plant orders nothing.
    chosen.seen = String(page.plant?.time ?? document.body.dataset.seen);
    order(chosen);
  });
})();
