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

/** What `pack` packed: {factor, candidate, reference, difference, error, z}, null where absent. */
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
  return pictures;
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
