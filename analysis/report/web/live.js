// Follows runs: asks the watcher for its state, and swaps the parts of the page that have changed.

const LOOK_MS = 2000, LOST_MS = 15000;
const known = new Map(JSON.parse(document.querySelector("script[data-state]").textContent).parts);
const held = new Set(); // ids of parts that wait until nobody is at them
let release = false;

const bar = document.createElement("div");
bar.className = "live";
const sign = document.createElement("span"), show = document.createElement("button");
sign.setAttribute("role", "status");
show.type = "button";
show.textContent = "Show what is new";
show.addEventListener("click", () => {
  release = true;
  look();
});
bar.append(sign, show);
document.body.append(bar);

/** Whether a mission plays in an element, or is stopped between its ends. */
function plays(within) {
  return [...within.querySelectorAll("[data-player]")].some((root) => {
    const end = Number(root.querySelector('[data-part="scrub"]').max);
    const time = Number(root.dataset.time);
    return root.dataset.playing === "true" || (time > 0 && time < end - 1e-3);
  });
}

/** Whether somebody is at an element, so that it may not change now. */
function isBusy(element) {
  const selected = getSelection();
  if (!selected.isCollapsed && element.contains(selected.anchorNode)) return true;
  const missions = element.id === "missions" || element.querySelector("[data-player], [data-map]");
  return Boolean(missions) && plays(document); // maps, players and missions change together
}

/** Returns what a reader has done to an element: opened, sorted and scrolled parts, the focus. */
function readTraces(element) {
  const all = (selector) => [...element.querySelectorAll(selector)];
  const focus = document.activeElement;
  return {
    open: new Map(all("details").map((each) => [nameOf(each), each.open])),
    sorted: all("table.sortable").map((table) => {
      const heads = [...table.tHead.rows[0].cells];
      const column = heads.findIndex((head) => head.hasAttribute("aria-sort"));
      return [column, column < 0 ? "" : heads[column].getAttribute("aria-sort")];
    }),
    scrolled: all(".table, pre").map((box) => [box.scrollLeft, box.scrollTop, isAtEnd(box)]),
    focus: element.contains(focus) ? all("*").indexOf(focus) : -1,
  };
}

/** Names a folded part by its heading, without the numbers that change. */
function nameOf(details) {
  const before = [...details.parentElement.children].slice(0, [...details.parentElement.children]
    .indexOf(details)).filter((each) => each.tagName === "H3").pop();
  return `${before?.textContent}/${details.querySelector("summary").textContent}`.replace(/\d+/g, "");
}

function isAtEnd(box) {
  return box.scrollHeight - box.scrollTop - box.clientHeight < 4;
}

function leaveTraces(element, { open, sorted, scrolled, focus }) {
  const all = (selector) => [...element.querySelectorAll(selector)];
  all("details").forEach((each) => {
    each.open = open.get(nameOf(each)) ?? each.open;
  });
  all("table.sortable").forEach((table, i) => {
    const [column, order] = sorted[i] || [-1, ""];
    const button = table.tHead.rows[0].cells[column]?.querySelector("button");
    for (let n = 0; button && n < (order === "descending" ? 2 : 1); n += 1) button.click();
  });
  all(".table, pre").forEach((box, i) => {
    const [left, top, atEnd] = scrolled[i] || [0, 0, true];
    box.scrollLeft = left;
    box.scrollTop = atEnd && box.classList.contains("log") ? box.scrollHeight : top;
  });
  if (focus >= 0) all("*")[focus]?.focus({ preventScroll: true });
}

/** Keeps what is on the screen where it is, while something else changes its height. */
function keepPlace(change) {
  const seen = [...document.querySelectorAll("section > *, section")].find((each) =>
    each.getBoundingClientRect().bottom > 60 && each.getBoundingClientRect().top > -2000);
  const section = seen?.closest("section"), id = section?.id;
  const before = section?.getBoundingClientRect().top;
  change();
  const after = id && document.getElementById(id)?.getBoundingClientRect().top;
  if (scrollY > 0 && after !== undefined && after !== before) scrollBy(0, after - before);
}

function swap(id, html) {
  const template = document.createElement("template");
  template.innerHTML = html;
  const next = template.content.firstElementChild, old = document.getElementById(id);
  const traces = old ? readTraces(old) : null;
  if (old) {
    leaveTables(old);
    old.replaceWith(next);
  } else document.querySelector("main").append(next);
  startTables(next);
  startPlayers(next);
  startMaps(next);
  if (traces) leaveTraces(next, traces);
}

async function ask(path) {
  const answer = await fetch(path, { cache: "no-store", credentials: "omit" });
  if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
  return answer;
}

/** Swaps the parts that have changed; missions first, as players read them when they start. */
async function renew(parts) {
  const ids = parts.map(([id]) => id);
  const changed = parts.filter(([id, digest]) => known.get(id) !== digest).map(([id]) => id);
  changed.sort((a, b) => (b === "missions") - (a === "missions"));
  const texts = new Map();
  for (const id of changed) {
    const element = document.getElementById(id);
    if (!release && element && isBusy(element)) held.add(id);
    else texts.set(id, await ask(`part/${id}`));
  }
  for (const [id, answer] of texts) texts.set(id, [await answer.text(), answer.headers.get("ETag")]);
  if (!texts.size) return;
  keepPlace(() => {
    for (const [id, [html, digest]] of texts) {
      swap(id, html);
      known.set(id, digest.replaceAll('"', ""));
      held.delete(id);
    }
    sortSections(ids);
  });
  if (texts.has("missions")) {
    document.querySelectorAll("[data-player]")
      .forEach((root) => root.dispatchEvent(new CustomEvent("renew")));
  }
}

/** Puts the sections in order, and takes out those that have gone. */
function sortSections(ids) {
  const main = document.querySelector("main");
  [...main.children].filter(({ id }) => !ids.includes(id)).forEach((each) => each.remove());
  const ordered = ids.map((id) => document.getElementById(id)).filter((each) => each?.parentElement === main);
  ordered.forEach((each, i) => {
    if (main.children[i] !== each) main.insertBefore(each, main.children[i]);
  });
}

const clock = (date) => date.toLocaleTimeString([], { hour12: false });
let seen = new Date(), looks = 0, waiting = null;

function describeFigures(drawn, behind) {
  if (!drawn) return behind ? " · figures are drawn" : "";
  return ` · figures of ${clock(new Date(drawn))}${behind ? ", new ones are drawn" : ""}`;
}

function tell({ state, drawn, behind }) {
  bar.dataset.state = state;
  sign.textContent = state === "lost"
    ? `No answer since ${clock(seen)}: evoros watch has ended.`
    : `${state} · read ${clock(seen)}${describeFigures(drawn, behind)}`;
  show.hidden = !held.size;
}

async function look() {
  clearTimeout(waiting);
  let next = LOOK_MS;
  try {
    const state = await (await ask("state")).json();
    seen = new Date();
    await renew(state.parts);
    release = false;
    looks += 1;
    bar.dataset.looks = looks;
    tell(state);
  } catch {
    tell({ state: "lost" });
    next = LOST_MS;
  }
  clearTimeout(waiting);
  if (!document.hidden) waiting = setTimeout(look, next);
}

document.addEventListener("visibilitychange", () => {
  if (!document.hidden) look();
});
document.querySelectorAll("pre.log").forEach((log) => {
  log.scrollTop = log.scrollHeight;
});
look();
