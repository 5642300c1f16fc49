// The pictures of one case: drawing, zoom, the pixel cursor and its readings.

/** Pixels of the screen within which a drag of a zoomed picture moves the slider. */
const NEAR_SLIDER = 24;

/** Smaller values have a power of ten and four digits: more are wider than a column. */
const SMALL = 1e-3;

/** A value with as many digits as were kept of it. */
function reading(value, digits) {
  if (Number.isNaN(value)) return "NaN";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const rounded = Number(value.toPrecision(digits));
  const isSmall = rounded && Math.abs(rounded) < SMALL;
  const text = isSmall ? Number(value.toPrecision(Math.min(digits, 4))).toExponential() : rounded;
  return String(text).replaceAll("-", "−");
}

function clamp(value, low, high) {
  return Math.min(Math.max(value, low), Math.max(low, high));
}

class CaseView {
  constructor(section) {
    this.section = section;
    this.box = section.querySelector(".pictures");
    this.row = this.box.querySelector(".row");
    /** Whose all pictures are, and which of them stand on the left and on the right. */
    this.whose = JSON.parse(this.box.dataset.whose);
    this.sides = [0, 1];
    this.choose("");
    this.figures = [...this.row.querySelectorAll("figure")].map((element) => this.figure(element));
    this.crops = [...section.querySelectorAll(".places button")].map((button) => new Crop(button));
    /** What of the pictures shows: from (left, top), as fractions, 1 / zoom of each side. */
    this.area = { zoom: 1, left: 0, top: 0 };
    this.cursor = null;
    this.sliding = false;
    /** Called with the section when the cursor has moved. */
    this.onlook = () => {};
    this.region = null;
    this.row.tabIndex = 0;
    this.trace = this.box.querySelector(".trace");
    this.command = this.trace?.querySelector("code").textContent;
    this.listen();
  }

  /** Take the numbers of a layer, "" for the picture itself. */
  choose(layer) {
    this.layer = layer;
    const stored = this.box.querySelector(layer ? `[data-layer="${layer}"]` : "script.data");
    this.data = JSON.parse(stored.textContent);
    this.factor = this.data.factor;
    /** Of what is read. */
    const digits = this.data.digits;
    this.digits = { candidate: digits, reference: digits, other: digits, difference: digits > 3 ? digits : 2, z: 2 };
    const { white, span } = layer ? stored.dataset : this.box.dataset;
    [this.white, this.ownSpan, this.stored] = [Number(white), Number(span), null];
    for (const figure of this.figures ?? []) {
      const { width, height } = this.data[figure.kind === "candidate" ? "candidate" : "reference"];
      Object.assign(figure, { width, height });
    }
    if (layer || this.figures) this.choosePair(0, 1);
  }

  /** Put two pictures, by number, on the left and on the right. */
  choosePair(left, right) {
    this.sides = [left, right];
    const names = this.sides.map((side) => this.whose[side]);
    for (const element of this.box.querySelectorAll("[data-side]")) {
      element.textContent = names[Number(element.dataset.side)];
    }
    [...this.box.querySelectorAll(".side")].forEach((select, k) => (select.value = this.sides[k]));
    for (const row of this.box.querySelectorAll("[data-number]")) {
      row.hidden = this.layer !== "" || this.sides.includes(Number(row.dataset.number));
    }
    this.pictures = null;
  }

  /** Show the pair that an address names, such as "0,2". */
  follow(pair, look) {
    const sides = (pair ?? "").split(",").map((text) => (/^\d+$/.test(text) ? Number(text) : this.whose.length));
    if (sides.length !== 2 || sides[0] === sides[1] || !sides.every((side) => side < this.whose.length)) return;
    this.showPair(sides, look);
  }

  /** The next picture on a side (0 or 1), not the one on the other side. */
  nextOn(side, look) {
    if (this.layer || this.whose.length < 3) return;
    const sides = [...this.sides];
    do sides[side] = (sides[side] + 1) % this.whose.length;
    while (sides[0] === sides[1]);
    this.showPair(sides, look);
  }

  showPair(sides, look) {
    this.choosePair(...sides);
    this.onlook(this.section);
    return this.show(look);
  }

  /** A canvas in place of the thumbnail; the map of FLIP is a picture already. */
  figure(element) {
    const kind = element.dataset.kind;
    const stored = this.data[kind === "candidate" ? kind : "reference"];
    const frame = element.querySelector(".frame");
    const canvas = document.createElement("canvas");
    const image = frame.querySelector("img");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", image.alt || element.querySelector("b").textContent);
    if (kind === "flip") image.classList.add("map");
    return {
      element, kind, frame, image, canvas: kind === "flip" ? image : canvas,
      width: stored.width, height: stored.height,
      low: element.querySelector(".low"), high: element.querySelector(".high"),
    };
  }

  /** Decode, unless it is done, and draw. */
  async show(look) {
    this.stored ??= await unpack(this.data);
    this.pictures = paired(this.stored, ...this.sides);
    this.look = look;
    const asJudged = this.sides[0] + this.sides[1] === 1;
    this.span = asJudged || !this.pictures.difference ? this.ownSpan : spanOf(this.pictures.difference);
    for (const { element, kind } of this.figures) {
      const isLayer = this.layer !== "";
      element.hidden = (kind === "z" && (isLayer || !this.pictures.z)) || (kind === "flip" && (isLayer || !asJudged));
    }
    const own = { ...look, white: this.white, span: this.span, kind: this.kindOfValues() };
    const drawn = this.figures.filter(({ kind, element }) => kind !== "flip" && !element.hidden);
    for (const figure of drawn) {
      paintKind(figure.canvas, figure.kind, this.pictures[figure.kind], own);
      figure.image.replaceWith(figure.canvas);
      const end = reading(this.span / 2 ** look.stops, 3);
      if (figure.high) [figure.low.textContent, figure.high.textContent] = [`−${end}`, `+${end}`];
    }
    this.box.querySelector(".exposed").textContent = this.exposed(look);
    this.crops.forEach((crop) => crop.draw(this.figures, this.factor));
    this.place();
    this.read();
    this.section.dataset.drawn = JSON.stringify(look);
  }

  /** The candidate alone, on a canvas in place of what is in `element`. */
  async drawInto(element, look) {
    const { candidate } = this.stored ?? (await unpack(this.data));
    const canvas = document.createElement("canvas");
    const own = { ...look, white: this.white, span: this.ownSpan, kind: this.kindOfValues() };
    paintKind(canvas, "candidate", candidate, own);
    element.replaceChildren(canvas);
  }

  /** Normals, values of both signs such as derivatives, or "". */
  kindOfValues() {
    if (this.layer === "normal") return "normals";
    return "signed" in this.box.dataset && !this.layer ? "signed" : "";
  }

  /** Give the memory back; what is drawn stays. */
  forget() {
    [this.stored, this.pictures] = [null, null];
  }

  exposed({ stops, colours }) {
    const white = this.white / 2 ** stops;
    if (this.layer === "normal") return "Normals: red, green and blue are x, y and z; grey is 0";
    if (this.kindOfValues()) {
      return `Red is ${reading(white, 4)}, blue is −${reading(white, 4)} in every picture`;
    }
    if (this.layer) return `White is a ${this.layer} of ${reading(white, 4)}`;
    if (colours === "linear") return `Luminance: yellow is ${reading(white, 4)}, purple is 0`;
    const dark = reading(white / 2 ** LOG_STOPS, 4);
    if (colours === "reinhard") return `Reinhard's curve: radiance ${reading(4 * white, 4)} is white`;
    if (colours === "filmic") return `A curve of film: radiance ${reading(white, 4)} is bright`;
    if (colours === "log") return `Luminance: yellow is ${reading(white, 4)}, purple is ${dark}`;
    return `White is radiance ${reading(white, 4)} W·sr⁻¹·m⁻² in every picture`;
  }

  listen() {
    for (const figure of this.figures) {
      const { frame } = figure;
      frame.addEventListener("pointermove", (event) => this.moved(figure, event));
      frame.addEventListener("pointerdown", (event) => this.pressed(figure, event));
      frame.addEventListener("dblclick", (event) => this.zoomAt(this.fractions(figure, event), 2));
      frame.addEventListener("wheel", (event) => this.wheeled(figure, event), { passive: false });
    }
    this.row.addEventListener("focus", () => this.moveCursor(0, 0));
    this.crops.forEach((crop) => crop.button.addEventListener("click", () => this.visit(crop)));
    for (const button of this.box.querySelectorAll("[data-zoom]")) {
      button.addEventListener("click", () => this.zoom(button.dataset.zoom));
    }
    this.box.querySelector(".layer")?.addEventListener("change", ({ target }) => {
      this.choose(target.value);
      this.show(this.look);
    });
    [...this.box.querySelectorAll(".side")].forEach((select, k) => {
      select.addEventListener("change", () => {
        const [before, other, chosen] = [this.sides[k], this.sides[1 - k], Number(select.value)];
        if (this.layer) this.choose((this.box.querySelector(".layer").value = ""));
        // What stands on the other side changes places with it.
        const freed = chosen === other ? before : other;
        this.showPair(k === 0 ? [chosen, freed] : [freed, chosen], this.look);
      });
    });
    this.wipe = this.box.querySelector(".wipe input");
    this.wipe.addEventListener("input", () => this.setWipe(Number(this.wipe.value)));
  }

  /** Percent of the frame from its left edge to the slider. */
  setWipe(percent) {
    this.wipe.value = clamp(percent, 0, 100);
    this.box.style.setProperty("--wipe", `${this.wipe.value}%`);
  }

  /** Whether a drag moves the slider: near it, or anywhere if there is nothing to pan. */
  moves(figure, event) {
    if (!["slider", "onion"].includes(document.body.dataset.mode)) return false;
    const box = figure.frame.getBoundingClientRect();
    const far = Math.abs(event.clientX - box.left - (box.width * Number(this.wipe.value)) / 100);
    return this.area.zoom === 1 || far < NEAR_SLIDER;
  }

  slide(figure, event) {
    const box = figure.frame.getBoundingClientRect();
    this.setWipe((100 * (event.clientX - box.left)) / box.width);
  }

  /** Where in the whole picture an event happened, as fractions of its sides. */
  fractions(figure, event) {
    const box = figure.frame.getBoundingClientRect();
    const { zoom, left, top } = this.area;
    return {
      x: left + (event.clientX - box.left) / box.width / zoom,
      y: top + (event.clientY - box.top) / box.height / zoom,
    };
  }

  moved(figure, event) {
    if (event.buttons === 1 && this.sliding) {
      this.slide(figure, event);
    } else if (event.buttons === 1 && this.area.zoom > 1) {
      const box = figure.frame.getBoundingClientRect();
      const { zoom, left, top } = this.area;
      const [x, y] = [event.movementX / box.width, event.movementY / box.height];
      this.setArea(zoom, left - x / zoom, top - y / zoom);
    } else if (event.pointerType !== "touch") {
      this.pointTo(figure, event);
    }
  }

  pressed(figure, event) {
    this.sliding = this.moves(figure, event);
    if (this.area.zoom > 1 || this.sliding) figure.frame.setPointerCapture(event.pointerId);
    if (this.sliding) this.slide(figure, event);
    this.pointTo(figure, event);
  }

  wheeled(figure, event) {
    // The wheel alone scrolls the page.
    if (!event.ctrlKey) return;
    event.preventDefault();
    this.zoomAt(this.fractions(figure, event), 2 ** (-event.deltaY / 200));
  }

  pointTo(figure, event) {
    const { x, y } = this.fractions(figure, event);
    this.setCursor(Math.floor(x * figure.width), Math.floor(y * figure.height));
  }

  setCursor(x, y) {
    const width = Math.max(...this.figures.map((figure) => figure.width));
    const height = Math.max(...this.figures.map((figure) => figure.height));
    this.cursor = { x: clamp(x, 0, width - 1), y: clamp(y, 0, height - 1) };
    this.place();
    this.read();
    this.onlook(this.section);
  }

  /** Move the cursor by pixels, and what shows along with it. */
  moveCursor(dx, dy) {
    const { width, height } = this.figures[0];
    const from = this.cursor ?? { x: Math.floor(width / 2), y: Math.floor(height / 2) };
    this.setCursor(from.x + dx, from.y + dy);
    const { zoom, left, top } = this.area;
    const [x, y] = [this.cursor.x / width, this.cursor.y / height];
    this.setArea(
      zoom,
      clamp(left, x + 1 / width - 1 / zoom, x),
      clamp(top, y + 1 / height - 1 / zoom, y),
    );
  }

  zoom(way) {
    const { width, height } = this.figures[0];
    const { zoom, left, top } = this.area;
    const middle = { x: left + 0.5 / zoom, y: top + 0.5 / zoom };
    const { x, y } = this.cursor
      ? { x: (this.cursor.x + 0.5) / width, y: (this.cursor.y + 0.5) / height }
      : middle;
    if (way === "whole") this.setArea(1, 0, 0);
    else this.zoomAt({ x: clamp(x, 0, 1), y: clamp(y, 0, 1) }, way === "in" ? 2 : 0.5);
  }

  /** Zoom so that a place of the picture, as fractions, stays where it is, if it shows. */
  zoomAt({ x, y }, by) {
    const { width, height } = this.figures[0];
    const { zoom, left, top } = this.area;
    const wanted = clamp(zoom * by, 1, Math.max(width, height) / 4);
    const [inX, inY] = [clamp((x - left) * zoom, 0, 1), clamp((y - top) * zoom, 0, 1)];
    this.setArea(wanted, x - inX / wanted, y - inY / wanted);
  }

  setArea(zoom, left, top) {
    const most = 1 - 1 / zoom;
    this.area = { zoom, left: clamp(left, 0, most), top: clamp(top, 0, most) };
    this.place();
  }

  /** Show a worst place large in every picture, with the cursor on its worst pixel. */
  visit(crop) {
    const { width, height } = this.figures[0];
    const place = crop.scaled(this.factor);
    const filled = 0.5 / Math.max(place.width / width, place.height / height);
    const zoom = clamp(filled, 1, Math.max(width, height) / 8);
    const [x, y] = [place.x + place.width / 2, place.y + place.height / 2];
    this.region = place;
    this.setArea(zoom, x / width - 0.5 / zoom, y / height - 0.5 / zoom);
    this.setCursor(...this.worstPixel(place));
    this.row.scrollIntoView({ block: "nearest" });
  }

  worstPixel(place) {
    const picture = this.pictures?.z ?? this.pictures?.difference;
    let [x, y, most] = [Math.floor(place.x), Math.floor(place.y), -1];
    if (!picture) return [x, y];
    for (let row = y; row < Math.min(place.y + place.height, picture.height); row += 1) {
      for (let column = Math.floor(place.x); column < place.x + place.width; column += 1) {
        const size = this.values(picture, column, row).reduce(
          // What is not a number is worse than any.
          (far, value) => Math.max(far, Number.isNaN(value) ? Infinity : Math.abs(value)), -1,
        );
        if (size > most) [x, y, most] = [column, row, size];
      }
    }
    return [x, y];
  }

  /** The three values of a pixel; none outside. */
  values(picture, x, y) {
    if (!picture || x >= picture.width || y >= picture.height) return [];
    const at = 3 * (y * picture.width + x);
    return [...picture.values.subarray(at, at + 3)];
  }

  /** Put the canvases and marks where zoom and cursor want them. */
  place() {
    const { zoom, left, top } = this.area;
    this.box.classList.toggle("zoomed", zoom > 1);
    // Those that do not show have no width; they get one when they do.
    const shown = Math.max(...this.figures.map(({ frame }) => frame.clientWidth));
    for (const { frame, canvas, width, height } of this.figures) {
      frame.style.setProperty("--zoom", zoom);
      frame.style.setProperty("--left", left);
      frame.style.setProperty("--top", top);
      canvas.classList.toggle("enlarged", shown * zoom >= width);
      const cursor = this.cursor && { ...this.cursor, width: 1, height: 1 };
      this.mark(frame.querySelector(".cursor"), cursor, width, height);
      this.mark(frame.querySelector(".region"), this.region, width, height);
    }
  }

  mark(element, place, width, height) {
    element.hidden = !place;
    if (!place) return;
    const { zoom, left, top } = this.area;
    const { style } = element;
    style.left = `${100 * zoom * (place.x / width - left)}%`;
    style.top = `${100 * zoom * (place.y / height - top)}%`;
    style.width = `${(100 * zoom * place.width) / width}%`;
    style.height = `${(100 * zoom * place.height) / height}%`;
  }

  read() {
    if (!this.cursor || !this.pictures) return;
    const { x, y } = this.cursor;
    const range = (at) => (this.factor > 1 ? `${at * this.factor} to ${(at + 1) * this.factor - 1}` : at);
    this.box.querySelector(".place").textContent = `x ${range(x)}, y ${range(y)}`;
    if (this.trace) {
      const middle = (at) => at * this.factor + Math.floor(this.factor / 2);
      this.trace.querySelector("code").textContent = `${this.command} --pixel ${middle(x)},${middle(y)}`;
      this.trace.hidden = false;
    }
    for (const row of this.box.querySelectorAll("[data-row]")) {
      const { row: kind, number } = row.dataset;
      const picture = number ? this.pictures.all[Number(number)] : this.pictures[kind];
      const values = this.values(picture, x, y);
      [...row.cells].slice(1).forEach((cell, k) => {
        cell.textContent = k < values.length ? reading(values[k], this.digits[kind]) : "–";
      });
    }
  }
}
