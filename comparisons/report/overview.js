// The table of cases: thumbnails, sorting; and which cases are expanded.

class Overview {
  /** sections: of the cases;  rows: of the table, in the same order. */
  constructor(sections, rows) {
    this.sections = sections;
    this.rows = rows;
    this.heads = [...document.querySelectorAll("nav thead [data-key]")];
    this.sorted = { key: "rank", down: false };
    this.onsort = () => {};
    sections.forEach((section, k) => this.thumbnail(section, rows[k]));
    for (const head of this.heads) {
      head.querySelector("button").addEventListener("click", () => this.turn(head.dataset.key));
    }
  }

  thumbnail(section, row) {
    const image = section.querySelector(".candidate img");
    if (!image) return;
    const small = document.createElement("img");
    small.src = image.src;
    small.alt = "";
    small.loading = "lazy";
    row.querySelector(".thumb").append(small);
  }

  /** Sort by a column, the second time the other way round. */
  turn(key) {
    this.sort(key, this.sorted.key === key && !this.sorted.down);
    this.onsort();
  }

  sort(key, down) {
    if (!this.heads.some((head) => head.dataset.key === key)) return;
    this.sorted = { key, down };
    const value = (row) => row.dataset[key];
    const order = this.rows.map((_, k) => k);
    const compare = (a, b) => {
      const [x, y] = [value(this.rows[a]), value(this.rows[b])];
      if (key === "name") return x.localeCompare(y, "en");
      // What has no number comes last, whichever way the others are sorted.
      const [m, n] = [x, y].map((text) => (text === "" || Number.isNaN(Number(text)) ? null : Number(text)));
      if (m === null || n === null) return ((m === null) - (n === null)) * (down ? -1 : 1);
      return m - n;
    };
    order.sort((a, b) => (down ? -1 : 1) * compare(a, b) || a - b);
    const [table, main] = [this.rows[0]?.parentElement, this.sections[0]?.parentElement];
    const last = main?.querySelector("#none");
    for (const k of order) {
      table.append(this.rows[k]);
      main.insertBefore(this.sections[k], last);
    }
    for (const head of this.heads) {
      if (head.dataset.key === key) head.setAttribute("aria-sort", down ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    }
  }

  /** The sections in the order in which they show. */
  get ordered() {
    return [...document.querySelectorAll("section.case")];
  }

  expand(all) {
    for (const section of this.sections) section.querySelector(".body").open = all;
  }
}
