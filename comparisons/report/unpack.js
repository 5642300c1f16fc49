// Float pictures out of a case's data: the same numbers as `unpack` of pictures_data.py.

async function inflate(base64) {
  const packed = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** A picture {width, height, values}: three values a pixel, row by row. */
function decode(stored, codes) {
  const floats = new Float32Array(codes.map((code) => code << stored.shift).buffer);
  const values = Float64Array.from(floats);
  for (const [index, value] of stored.beyond) values[index] = value;
  return { width: stored.width, height: stored.height, values };
}

/** From the differences between the codes of two pictures, zigzag coded, to those of the second. */
function codesBeside(base, zigzag) {
  return base.map((code, i) => code + ((zigzag[i] >>> 1) ^ -(zigzag[i] & 1)));
}

/** What `pack` packed: {factor, candidate, reference, difference, error, z}, null where absent, and
 *  a list of others. */
async function unpack(data) {
  const bytes = await inflate(data.bytes);
  let start = 0;
  const next = (stored) => {
    const count = 3 * stored.width * stored.height;
    const codes = new Uint32Array(count);
    for (let plane = 0; plane < 4; plane += 1, start += count) {
      for (let i = 0; i < count; i += 1) codes[i] = (codes[i] << 8) | bytes[start + i];
    }
    return codes;
  };
  const base = next(data.reference);
  const others = next(data.candidate);
  const pictures = {
    factor: data.factor,
    reference: decode(data.reference, base),
    candidate: decode(data.candidate, data.rest ? codesBeside(base, others) : others),
    difference: null,
    error: null,
    z: null,
  };
  if (data.rest) pictures.difference = difference(pictures, decode(data.rest, next(data.rest)));
  if (data.error) {
    pictures.error = decode(data.error, next(data.error));
    pictures.z = quotient(pictures);
  }
  pictures.others = data.others.map((stored) => decode(stored, next(stored)));
  return pictures;
}

const negative = (picture) => picture && { ...picture, values: picture.values.map((value) => -value) };

/** Of all pictures, by number (the candidate, the reference, the others), two as candidate and
 *  reference.  Noise is known of the difference of the first two alone. */
function paired(pictures, left, right) {
  const all = [pictures.candidate, pictures.reference, ...pictures.others];
  const [candidate, reference] = [all[left], all[right]];
  const pair = { ...pictures, all, candidate, reference };
  if (left + right === 1) {
    const turned = left > right ? negative : (picture) => picture;
    return { ...pair, difference: turned(pictures.difference), z: turned(pictures.z) };
  }
  const values = candidate.values.map((value, i) => value - reference.values[i]);
  return { ...pair, difference: { ...candidate, values }, error: null, z: null };
}

/** The share of differences below which the end of their colours lies, as in thumbnails.py. */
const DIFFERENCE_SHARE = 0.995;

/** Of a difference: the end of its colours. */
function spanOf({ width, height, values }) {
  const sizes = new Float64Array(width * height);
  for (let i = 0; i < sizes.length; i += 1) {
    const most = Math.max(...[0, 1, 2].map((k) => Math.abs(values[3 * i + k])));
    sizes[i] = Number.isFinite(most) ? most : 0;
  }
  sizes.sort();
  return sizes[Math.floor(DIFFERENCE_SHARE * (sizes.length - 1))] || sizes.at(-1);
}

function difference({ candidate, reference }, rest) {
  const values = candidate.values.map((value, i) => value - reference.values[i] + rest.values[i]);
  return { ...candidate, values };
}

/** What float32 arithmetic may make of a value, relatively: sixteen roundings. */
const ROUNDING = 2 ** -20;

/** Differences in standard errors: 0 where rounding explains them, something over nothing infinite. */
function quotient({ difference, error, reference }) {
  const values = difference.values.map((value, i) =>
    Math.abs(value) <= ROUNDING * Math.abs(reference.values[i]) ? 0 : value / error.values[i]);
  return { ...difference, values };
}
