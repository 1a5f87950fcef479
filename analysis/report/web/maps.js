// Maps of an archive and a front: a cell or a point is chosen, and its design appears.

/** Returns the nearest of other marks in a direction; what lies aside counts as farther. */
function nextMark(marks, from, [dx, dy]) {
  let next = null, least = Infinity;
  for (const mark of marks) {
    const x = Number(mark.dataset.x) - Number(from.dataset.x);
    const y = Number(mark.dataset.y) - Number(from.dataset.y);
    const ahead = x * dx + y * dy, aside = Math.abs(x * dy - y * dx);
    if (ahead <= 1e-6 || aside > 2 * ahead || ahead + 2 * aside >= least) continue;
    least = ahead + 2 * aside;
    next = mark;
  }
  return next;
}

function startMap(root) {
  const name = root.dataset.map;
  const content = JSON.parse(document.querySelector(`script[data-designs="${name}"]`).textContent);
  const player = document.querySelector(`[data-player="${name}"]`);
  const marks = [...root.querySelectorAll('[role="radio"]')];
  const find = (part) => root.querySelector(`[data-part="${part}"]`);
  const canvas = find("design");
  const keyOf = ({ run, design }) => `${run}/${design}`;
  let chosen = 0;

  function draw() {
    const style = getComputedStyle(root), ratio = Math.max(1, window.devicePixelRatio || 1);
    const colour = (key) => style.getPropertyValue(`--${key}`).trim();
    if (!canvas.clientWidth) return; // hidden
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    const look = Object.fromEntries(["paper", "ink", "body", "wheel", "silent", "grid"]
      .map((key) => [key, colour(key)]));
    look.pairs = [0, 1, 2, 3, 4, 5, 6].map((i) => colour(`pair${i}`));
    const context = canvas.getContext("2d"), pose = { x: 0, y: 0, yaw: Math.PI / 2 };
    const view = viewOf(canvas, 0, 0, 3.2 * content.reach);
    const sensors = content.designs[chosen].sensors.map((sensor) =>
      ({ ...sensor, range: Math.min(sensor.range, content.reach) }));
    const seen = ({ range }) => ({ reading: 0.97 * range, sectors: null, fault: null, failed: false });
    drawGrid(context, canvas, view, 0.5, look.grid);
    sensors.forEach((each) => drawCone(context, view, pose, each, seen(each), look, ratio));
    drawRobot(context, view, pose, content.parts, look, ratio);
    sensors.forEach((each) => drawSensor(context, view, pose, each, seen(each), look, ratio));
    drawScale(context, canvas, view, 0.5, look, ratio);
  }

  /** Shows a design; the player follows unless it was the player that chose it. */
  function choose(place, follow) {
    chosen = place;
    marks.forEach((mark, i) => {
      mark.setAttribute("aria-checked", i === place);
      mark.tabIndex = i === place ? 0 : -1;
    });
    const entry = content.designs[place], mark = marks[place];
    find("name").textContent = `design ${entry.design} of ${entry.run}`;
    find("values").replaceChildren(...entry.values.flatMap(([term, value]) =>
      [["dt", term], ["dd", value]].map(([tag, text]) => {
        const element = document.createElement(tag);
        element.textContent = text;
        return element;
      })));
    find("silent").hidden = !mark.classList.contains("still");
    root.dataset.chosen = keyOf(entry);
    draw();
    if (follow && player) player.dispatchEvent(new CustomEvent("choose", { detail: keyOf(entry) }));
  }

  marks.forEach((mark, i) => mark.addEventListener("click", () => choose(i, true)));
  root.querySelector('[role="radiogroup"]').addEventListener("keydown", (event) => {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (!ways[event.key]) return;
    event.preventDefault();
    const next = nextMark(marks, marks[chosen], ways[event.key]);
    if (!next) return;
    choose(marks.indexOf(next), true);
    next.focus();
  });
  if (player) {
    player.addEventListener("chosen", ({ detail }) =>
      choose(content.designs.findIndex((entry) => keyOf(entry) === detail), false));
  }
  root.addEventListener("fit", draw);
  const best = content.designs.map((entry) => Number(entry.values[0][1]));
  choose(best.indexOf(Math.max(...best)), true);
}

function startMaps(within) {
  within.querySelectorAll("[data-map]").forEach(startMap);
}

startMaps(document);
