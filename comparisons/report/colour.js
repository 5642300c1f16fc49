// Colours of float pictures on a canvas.

const MAGENTA = [255, 0, 255];
/** Ends and middle of ColorBrewer's RdBu, as in thumbnails.py and page.css. */
const RED = [178, 24, 43];
const WHITE = [255, 255, 255];
const BLUE = [33, 102, 172];

/** The map viridis (van der Walt and Smith 2015, CC0) at multiples of 1/16. */
const VIRIDIS = [
  [68, 1, 84], [72, 24, 106], [71, 45, 123], [66, 64, 134], [59, 82, 139], [51, 99, 141],
  [44, 114, 142], [38, 130, 142], [33, 145, 140], [31, 160, 136], [40, 174, 128],
  [63, 188, 115], [94, 201, 98], [132, 212, 75], [173, 220, 48], [216, 226, 25], [253, 231, 37],
];

/** Powers of two that the logarithmic false colours span, below white. */
const LOG_STOPS = 10;

/** z-maps end at this many standard errors. */
const Z_SPAN = 5;

/** Linear 0 to 1 (clipped) to sRGB 0 to 255, IEC 61966-2-1. */
function srgb(linear) {
  const x = Math.min(Math.max(linear, 0), 1);
  return Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
}

function mixed(from, to, amount) {
  return from.map((start, k) => Math.round(start + amount * (to[k] - start)));
}

/** 0 to 1, clipped, to a colour. */
function viridis(amount) {
  const at = 16 * Math.min(Math.max(amount, 0), 1);
  const below = Math.min(Math.floor(at), 15);
  return mixed(VIRIDIS[below], VIRIDIS[below + 1], at - below);
}

/** Relative luminance of linear sRGB (Rec. 709). */
function luminance(r, g, b) {
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

/** Reinhard et al. 2002, eq. 4, with the value 4 as white. */
function reinhard(x) {
  return (x * (1 + x / 16)) / (1 + x);
}

/** A curve of film, fitted to ACES (Narkowicz 2015, CC0). */
function filmic(x) {
  return (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14);
}

function toned(curve, r, g, b) {
  return [r, g, b].map((value) => srgb(curve(Math.max(value, 0))));
}

/** Radiance r, g, b in units of white to a colour. */
const RADIANCE = {
  srgb: (r, g, b) => [srgb(r), srgb(g), srgb(b)],
  reinhard: (r, g, b) => toned(reinhard, r, g, b),
  filmic: (r, g, b) => toned(filmic, r, g, b),
  linear: (r, g, b) => viridis(luminance(r, g, b)),
  log: (r, g, b) => viridis(1 + Math.log2(Math.max(luminance(r, g, b), 0)) / LOG_STOPS),
};

/** Signed r, g, b in units of the span: the one that is farthest from 0. */
function signed(r, g, b) {
  const most = [r, g, b].reduce((far, value) => (Math.abs(value) > Math.abs(far) ? value : far));
  return mixed(WHITE, most > 0 ? RED : BLUE, Math.min(Math.abs(most), 1));
}

/** Draw a picture, `unit` being white or the span; magenta where `isBad` of a value. */
function paint(canvas, picture, unit, colourOf, isBad) {
  const { width, height, values } = picture;
  const image = new ImageData(width, height);
  for (let i = 0; i < width * height; i += 1) {
    const [r, g, b] = [values[3 * i], values[3 * i + 1], values[3 * i + 2]];
    const bad = isBad(r) || isBad(g) || isBad(b);
    const colour = bad ? MAGENTA : colourOf(r / unit, g / unit, b / unit);
    image.data.set(colour, 4 * i);
    image.data[4 * i + 3] = 255;
  }
  canvas.width = width;
  canvas.height = height;
  // Kept in plain memory, where all of this happens.
  canvas.getContext("2d", { willReadFrequently: true }).putImageData(image, 0, 0);
}

const notFinite = (value) => !Number.isFinite(value);

/** Draw one kind of picture of a case as `look` {white, span, stops, colours} says. */
function paintKind(canvas, kind, picture, look) {
  const gain = 2 ** look.stops;
  if (kind === "z") {
    // An infinite z is a difference where there is no noise: no fault of the pixel.
    paint(canvas, picture, Z_SPAN, signed, Number.isNaN);
  } else if (kind === "difference") {
    paint(canvas, picture, look.span / gain || 1, signed, notFinite);
  } else if (look.kind === "signed") {
    paint(canvas, picture, look.white / gain, signed, notFinite);
  } else if (look.kind === "normals") {
    const shade = (value) => Math.round(127.5 * (1 + Math.min(Math.max(value, -1), 1)));
    paint(canvas, picture, 1, (...values) => values.map(shade), notFinite);
  } else {
    paint(canvas, picture, look.white / gain, RADIANCE[look.colours], notFinite);
  }
}
