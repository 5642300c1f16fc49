// The page: which cases show, how their pictures show, and the keyboard.

const COLOURS = ["srgb", "reinhard", "filmic", "linear", "log"];
const WHICH = ["candidate", "reference", "difference", "z", "flip"];
const BLINK_MILLISECONDS = 700;

const find = (selector) => document.querySelector(selector);
const sections = [...document.querySelectorAll(".case")];
const rows = [...document.querySelectorAll("nav tbody:not(.idle) tr")];
const views = new Map();
const look = { stops: 0, colours: "srgb" };
const overview = new Overview(sections, rows);
/** The case that was looked at last. */
let looked = null;

/** The pictures of a case, made when they are first needed; undefined if there are none. */
function viewOf(section) {
  if (!views.has(section) && section?.querySelector("script.data")) {
    const view = new CaseView(section);
    view.onlook = (at) => {
      looked = at;
      address.changed();
    };
    views.set(section, view);
  }
  return views.get(section);
}

// Cases: search, verdicts, next and previous

const texts = sections.map((section) => {
  const parts = section.querySelectorAll("h2, .headline, .reason, .cause");
  return [...parts].map((part) => part.textContent).join(" ").toLowerCase();
});

function filter() {
  const words = find("#search").value.toLowerCase().split(/\s+/);
  const boxes = [...document.querySelectorAll("[name=verdict]:checked")];
  const verdicts = new Set(boxes.map((box) => box.value));
  let count = 0;
  sections.forEach((section, k) => {
    const matches = words.every((word) => texts[k].includes(word));
    const shown = matches && verdicts.has(section.dataset.verdict);
    section.hidden = !shown;
    rows[k].hidden = !shown;
    count += shown;
  });
  find("#shown").textContent = `${count} of ${sections.length}`;
  address.changed();
  find("#none").hidden = count > 0 || sections.length === 0;
}

/** The case that has the focus, else the last one that begins above the window's upper third. */
function current() {
  const focused = document.activeElement.closest(".case:not([hidden])");
  if (focused) return focused;
  const above = (section) => section.getBoundingClientRect().top < window.innerHeight / 3;
  return overview.ordered.filter((section) => !section.hidden).findLast(above);
}

function step(by) {
  const shown = overview.ordered.filter((section) => !section.hidden);
  const next = shown[shown.indexOf(current()) + by] ?? current();
  if (next) goTo(next);
}

function goTo(section) {
  section.scrollIntoView();
  const row = section.querySelector(".body").open && viewOf(section)?.row;
  (row || section).focus({ preventScroll: true });
  looked = section;
  address.changed();
}

function toggle(section) {
  const body = section?.querySelector(".body");
  if (body) body.open = !body.open;
}

// Pictures: views, exposure, colours

/** The cases in the window or not far from it. */
const near = new Set();

const drawn = new IntersectionObserver(
  (entries) => {
    for (const { target, isIntersecting } of entries) {
      near[isIntersecting ? "add" : "delete"](target);
      if (isIntersecting) draw(target);
      else views.get(target)?.forget();
    }
  },
  { rootMargin: "400px" },
);

async function draw(section) {
  if (!section.querySelector(".body").open) return;
  try {
    await viewOf(section).show(look);
  } catch (error) {
    // The thumbnails remain.
    const hint = section.querySelector(".exposed");
    hint.textContent = `The pictures cannot be decoded (${error.message}): these are thumbnails`;
  }
}

function redraw() {
  find("#stops").value = look.stops;
  find("#stops-text").textContent = look.stops > 0 ? `+${look.stops}` : `${look.stops}`.replace("-", "−");
  find("#colours").value = look.colours;
  near.forEach(draw);
  address.changed();
}

function expose(stops) {
  const { min, max } = find("#stops");
  look.stops = clamp(stops, Number(min), Number(max));
  redraw();
}

function colour(colours) {
  look.colours = colours;
  redraw();
}

let blinking = null;

function setMode(mode) {
  const section = current();
  const before = section?.getBoundingClientRect().top;
  document.body.dataset.mode = mode;
  find(`[name=mode][value=${mode}]`).checked = true;
  clearInterval(blinking);
  if (mode === "blink") blinking = setInterval(flip, BLINK_MILLISECONDS);
  if (mode !== "single" && WHICH.indexOf(document.body.dataset.which) > 1) setWhich("candidate");
  // Pictures change their size: keep what is looked at where it is.
  if (section) window.scrollBy(0, section.getBoundingClientRect().top - before);
  resized();
  address.changed();
}

function resized() {
  for (const section of near) views.get(section)?.place();
}

function setWhich(which) {
  document.body.dataset.which = which;
  find("#which").value = which;
  address.changed();
}

/** The other picture of the pair; of a single view, the next one. */
function flip() {
  const { mode, which } = document.body.dataset;
  const among = mode === "single" ? WHICH : WHICH.slice(0, 2);
  setWhich(among[(WHICH.indexOf(which) + 1) % among.length]);
}

function flipKey() {
  if (!["flip", "single"].includes(document.body.dataset.mode)) setMode("flip");
  flip();
}

// The address

function state() {
  const { mode, which } = document.body.dataset;
  const boxes = [...document.querySelectorAll("[name=verdict]")];
  const checked = boxes.filter((box) => box.checked).map((box) => box.value);
  const view = views.get(looked);
  const { x, y } = view?.cursor ?? {};
  const { key, down } = overview.sorted;
  return {
    case: looked?.dataset.name ?? "",
    view: mode,
    of: mode === "flip" || mode === "single" ? which : "candidate",
    x: x ?? "",
    y: y ?? "",
    pair: view?.sides.join() ?? "",
    stops: String(look.stops),
    colours: look.colours,
    search: find("#search").value,
    only: checked.length === boxes.length ? "" : checked.join(" "),
    sort: key,
    order: down ? "down" : "up",
    cases: document.body.dataset.layout,
  };
}

const address = new Address(state);

/** Show what an address says. */
async function follow(fragment) {
  const wanted = readFragment(fragment);
  if (!wanted) return;
  if (wanted.search !== undefined) find("#search").value = wanted.search;
  if (wanted.only !== undefined) {
    const only = wanted.only.split(" ");
    for (const box of document.querySelectorAll("[name=verdict]")) box.checked = only.includes(box.value);
  }
  filter();
  setLayout(wanted.cases === "grid" ? "grid" : "list");
  if (wanted.sort) overview.sort(wanted.sort, wanted.order === "down");
  if (modes.includes(wanted.view)) setMode(wanted.view);
  if (WHICH.includes(wanted.of)) setWhich(wanted.of);
  if (COLOURS.includes(wanted.colours)) look.colours = wanted.colours;
  expose(Number(wanted.stops) || 0);
  const section = sections.find(({ dataset }) => dataset.name === wanted.case);
  if (!section) return;
  section.querySelector(".body").open = true;
  goTo(section);
  viewOf(section)?.follow(wanted.pair, look);
  const [x, y] = [Number(wanted.x), Number(wanted.y)];
  if (wanted.x !== undefined && Number.isInteger(x) && Number.isInteger(y)) viewOf(section)?.setCursor(x, y);
}

/** The cases as a list with numbers, or as a grid of pictures. */
function setLayout(layout) {
  document.body.dataset.layout = layout;
  find("#layout").textContent = layout === "grid" ? "list" : "grid";
  if (layout === "grid") rows.forEach((row) => enlarged.observe(row));
  address.changed();
}

/** Draws pictures of the grid when they come near the window: thumbnails would be too coarse. */
const enlarged = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    if (!isIntersecting) continue;
    enlarged.unobserve(target);
    viewOf(sections[rows.indexOf(target)])?.drawInto(target.querySelector(".thumb"), look);
  }
});

// Commands to copy

async function copy(button) {
  const code = button.parentElement.querySelector("code");
  try {
    await navigator.clipboard.writeText(code.textContent);
    button.textContent = "copied";
  } catch {
    // Where a page from disk may not write to the clipboard, the user can.
    getSelection().selectAllChildren(code);
    button.textContent = "selected: press Ctrl+C";
  }
  setTimeout(() => (button.textContent = "copy"), 2000);
}

// Keys

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

const modes = [...document.querySelectorAll("[name=mode]")].map((radio) => radio.value);

const KEYS = {
  n: () => step(1),
  p: () => step(-1),
  f: flipKey,
  a: () => viewOf(current())?.nextOn(0, look),
  b: () => viewOf(current())?.nextOn(1, look),
  c: () => colour(COLOURS[(COLOURS.indexOf(look.colours) + 1) % COLOURS.length]),
  "+": () => expose(look.stops + 1),
  "=": () => expose(look.stops + 1),
  "-": () => expose(look.stops - 1),
  0: () => expose(0),
  e: () => toggle(current()),
  i: () => viewOf(current())?.zoom("in"),
  o: () => viewOf(current())?.zoom("out"),
  w: () => viewOf(current())?.zoom("whole"),
  "/": () => find("#search").focus(),
  "?": () => find("#help").showModal(),
  ...Object.fromEntries(modes.map((mode, k) => [k + 1, () => setMode(mode)])),
};

function pressed(event) {
  const { target, key } = event;
  if (event.ctrlKey || event.metaKey || event.altKey || find("#help").open) return;
  if (target.matches("[type=search], select")) {
    if (key === "Escape") target.blur();
    return;
  }
  const view = target.matches(".row") ? views.get(target.closest(".case")) : null;
  if (view && key in ARROWS) {
    const far = event.shiftKey ? 10 : 1;
    view.moveCursor(...ARROWS[key].map((d) => far * d));
  } else if (Object.hasOwn(KEYS, key)) {
    KEYS[key]();
  } else {
    return;
  }
  event.preventDefault();
}

document.documentElement.classList.add("scripted");
sections.forEach((section, k) => {
  if (section.querySelector("script.data")) {
    drawn.observe(section);
    section.querySelector(".body").addEventListener("toggle", () => near.has(section) && draw(section));
  }
  const fragment = `#${writeFragment({ case: section.dataset.name })}`;
  section.querySelector(".permalink").setAttribute("href", fragment);
  const entry = rows[k].querySelector("a");
  entry.setAttribute("href", fragment);
  entry.addEventListener("click", (event) => {
    event.preventDefault();
    section.querySelector(".body").open = true;
    goTo(section);
  });
});
overview.onsort = () => address.changed();
find("#expand").addEventListener("click", ({ target }) => {
  const all = target.getAttribute("aria-pressed") !== "true";
  target.setAttribute("aria-pressed", String(all));
  target.textContent = all ? "collapse all" : "expand all";
  overview.expand(all);
});
find("#layout").addEventListener("click", ({ target }) => setLayout(target.textContent));
window.addEventListener("hashchange", () => follow(location.hash));
document.addEventListener("keydown", pressed);
window.addEventListener("resize", resized);
find(".toolbar").addEventListener("submit", (event) => event.preventDefault());
find("#search").addEventListener("input", filter);
find("#stops").addEventListener("input", (event) => expose(Number(event.target.value)));
find("#colours").addEventListener("change", (event) => colour(event.target.value));
find("#which").addEventListener("change", (event) => setWhich(event.target.value));
find("#open-help").addEventListener("click", KEYS["?"]);
for (const box of document.querySelectorAll("[name=verdict]")) box.addEventListener("change", filter);
for (const radio of document.querySelectorAll("[name=mode]")) {
  radio.addEventListener("change", () => setMode(radio.value));
}
for (const button of document.querySelectorAll(".copy")) {
  button.addEventListener("click", () => copy(button));
}
// A browser that reloads the page keeps what was typed and chosen.
setMode(find("[name=mode]:checked").value);
expose(Number(find("#stops").value));
filter();
follow(location.hash);
