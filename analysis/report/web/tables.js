// Sorts a table by the column whose heading is clicked, and shows where a table goes on.

function sortBy(table, column, descending) {
  const keyOf = (row) => row.cells[column].textContent;
  const body = table.tBodies[0];
  const rows = [...body.rows].sort((one, other) => {
    const [a, b] = [keyOf(one), keyOf(other)];
    const [x, y] = [parseFloat(a), parseFloat(b)];
    if (a === "" || b === "") return (a === "") - (b === ""); // empty cells stay last
    const order = Number.isNaN(x) || Number.isNaN(y) ? a.localeCompare(b, "en") : x - y;
    return descending ? -order : order;
  });
  body.append(...rows);
}

function startSorting(table) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    head.querySelector("button").addEventListener("click", () => {
      const descending = head.getAttribute("aria-sort") === "ascending";
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", descending ? "descending" : "ascending");
      sortBy(table, column, descending);
    });
  });
}

// Fades the edges behind which a table goes on, and says so below it.
function showMore(box) {
  const wide = box.scrollWidth - box.clientWidth;
  const tall = box.scrollHeight - box.clientHeight;
  const sides = {
    left: box.scrollLeft > 1,
    right: wide - box.scrollLeft > 1,
    down: tall - box.scrollTop > 1,
  };
  const more = Object.keys(sides).filter((side) => sides[side]);
  if (more.length) box.dataset.more = more.join(" ");
  else delete box.dataset.more;
  const parts = [...(wide > 1 ? ["columns"] : []), ...(tall > 1 ? ["rows"] : [])];
  const hint = box.nextElementSibling;
  hint.hidden = !parts.length;
  hint.textContent = `Scroll the table for more ${parts.join(" and ")}.`;
}

const observer = new ResizeObserver((entries) => entries.forEach((entry) => showMore(entry.target)));
function startScrolling(box) {
  const hint = document.createElement("p");
  hint.className = "more quiet";
  box.after(hint);
  box.addEventListener("scroll", () => showMore(box), { passive: true });
  observer.observe(box);
  showMore(box);
}

function startTables(within) {
  within.querySelectorAll("table.sortable").forEach(startSorting);
  within.querySelectorAll(".table").forEach(startScrolling);
}

/** Ends what watches the tables of an element that leaves the page. */
function leaveTables(within) {
  within.querySelectorAll(".table").forEach((box) => observer.unobserve(box));
}

startTables(document);
