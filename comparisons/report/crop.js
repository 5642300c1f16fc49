// A worst place: a button with both pictures of it, which shows it large.

class Crop {
  constructor(button) {
    this.button = button;
    const { x, y, width, height } = button.dataset;
    /** In pixels of the pictures as they were compared. */
    this.place = { x: Number(x), y: Number(y), width: Number(width), height: Number(height) };
  }

  /** The place in pixels of pictures that are stored `factor` times smaller. */
  scaled(factor) {
    const { x, y, width, height } = this.place;
    return { x: x / factor, y: y / factor, width: width / factor, height: height / factor };
  }

  /** Candidate and reference around the place, out of what `figures` have drawn. */
  draw(figures, factor) {
    const { x, y, width, height } = this.scaled(factor);
    // Half as much again on each side, to see what the place belongs to.
    const side = Math.ceil(Math.max(8, 2 * width, 2 * height));
    const [left, top] = [Math.round(x + (width - side) / 2), Math.round(y + (height - side) / 2)];
    const crops = figures
      .filter(({ kind }) => kind === "candidate" || kind === "reference")
      .map(({ canvas }) => {
        const crop = document.createElement("canvas");
        [crop.width, crop.height] = [side, side];
        crop.setAttribute("aria-hidden", "true");
        crop.getContext("2d").drawImage(canvas, left, top, side, side, 0, 0, side, side);
        return crop;
      });
    this.button.querySelector(".crops").replaceChildren(...crops);
  }
}
