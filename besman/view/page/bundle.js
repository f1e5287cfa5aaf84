// Bundles of JSON and arrays; besman/view/packing.py says how they are packed.

const NOT_SEEN = -32768;

/**
 * Unpack a bundle.
 * @param {Uint8Array} bytes
 * @returns {Promise<object>} the JSON, every array in the place of what refers to it:
 *   `{values, shape}` with a Float32Array (NaN: not seen), or a Uint16Array of indices
 */
export async function unpack(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const whole = await new Response(stream).arrayBuffer();
  const length = new DataView(whole).getUint32(0, true);
  const content = JSON.parse(new TextDecoder().decode(new Uint8Array(whole, 4, length)));
  const numbers = new Int16Array(whole, 4 + length);
  return resolve(content, numbers);
}

function resolve(node, numbers) {
  if (Array.isArray(node)) return node.map((one) => resolve(one, numbers));
  if (node === null || typeof node !== "object") return node;
  if ("at" in node && "shape" in node) return array(node, numbers);
  return Object.fromEntries(Object.entries(node).map(([key, one]) => [key, resolve(one, numbers)]));
}

function array({ at, shape, step }, numbers) {
  const size = shape.reduce((product, side) => product * side, 1);
  const columns = shape[0] ? size / shape[0] : 0;
  // An array of small integers, so that sums wrap around as the differences did.
  const whole = step === undefined ? new Uint16Array(size) : new Int16Array(size);
  for (let k = 0; k < size; k++) {
    whole[k] = numbers[at + k] + (k < columns ? 0 : whole[k - columns]);
  }
  if (step === undefined) return { values: whole, shape };
  const values = new Float32Array(size);
  for (let k = 0; k < size; k++) values[k] = whole[k] === NOT_SEEN ? NaN : step * whole[k];
  return { values, shape };
}

/** Decode base64 into bytes. */
export function fromBase64(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}
