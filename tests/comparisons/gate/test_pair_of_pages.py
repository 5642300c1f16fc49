"""The two back ends of a web page, WebGL and WebGPU, as a pair (by SwiftShader where no GPU is)."""

from pathlib import Path

import pytest
from gate_checks import run

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("chromium")]

PAGE = """<script>
const hash = `
  uint hash(uint x) { x ^= x >> 16u; x *= 0x7feb352du; x ^= x >> 15u; x *= 0x846ca68bu;
    return x ^ (x >> 16u); }`;
async function webgl(width, height, seed) {
  const gl = new OffscreenCanvas(width, height).getContext("webgl2");
  gl.getExtension("EXT_color_buffer_float");
  const program = gl.createProgram();
  const add = (kind, text) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, "#version 300 es\\nprecision highp float;precision highp int;" + text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  };
  add(gl.VERTEX_SHADER, `void main() {
    vec2 p = vec2(gl_VertexID & 1, gl_VertexID >> 1); gl_Position = vec4(4.0 * p - 1.0, 0, 1); }`);
  add(gl.FRAGMENT_SHADER, `out vec4 c; uniform uint seed; uniform vec2 size;` + hash + `
    void main() { uvec2 at = uvec2(gl_FragCoord.xy); vec2 p = vec2(at) / size;
      uint h = hash(at.x + at.y * 4096u + seed * 16777259u);
      float v = 0.3 + 0.4 * p.x + 0.2 * p.y + 0.1 * float(h >> 8u) / 16777216.0;
      c = vec4(v, v, v, 1); }`);
  gl.linkProgram(program);
  gl.useProgram(program);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, width, height);
  const texture = gl.getParameter(gl.TEXTURE_BINDING_2D);
  gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  gl.viewport(0, 0, width, height);
  gl.uniform1ui(gl.getUniformLocation(program, "seed"), seed >>> 0);
  gl.uniform2f(gl.getUniformLocation(program, "size"), width, height);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  const pixels = new Float32Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, pixels);
  return pixels;
}
async function webgpu(width, height, seed) {
  const device = await (await navigator.gpu.requestAdapter()).requestDevice();
  const module = device.createShaderModule({ code: `
    @group(0) @binding(0) var<storage, read_write> c: array<f32>;
    fn hash(y: u32) -> u32 { var x = y; x ^= x >> 16u; x *= 0x7feb352du; x ^= x >> 15u;
      x *= 0x846ca68bu; return x ^ (x >> 16u); }
    @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) at: vec3u) {
      let p = vec2f(at.xy) / vec2f(${width}.0, ${height}.0);
      let h = hash(at.x + at.y * 4096u + ${seed >>> 0}u * 16777259u);
      let v = 0.3 + 0.4 * p.x + 0.2 * p.y + 0.1 * f32(h >> 8u) / 16777216.0;
      let k = 4u * (at.y * ${width}u + at.x);
      c[k] = v; c[k + 1u] = v; c[k + 2u] = v; c[k + 3u] = 1.0; }` });
  const size = 16 * width * height, U = GPUBufferUsage;
  const made = device.createBuffer({ size, usage: U.STORAGE | U.COPY_SRC });
  const read = device.createBuffer({ size, usage: U.COPY_DST | U.MAP_READ });
  const compute = { module, entryPoint: "main" };
  const pipeline = device.createComputePipeline({ layout: "auto", compute });
  const group = device.createBindGroup({ layout: pipeline.getBindGroupLayout(0),
    entries: [{ binding: 0, resource: { buffer: made } }] });
  const encoder = device.createCommandEncoder(), pass = encoder.beginComputePass();
  pass.setPipeline(pipeline);
  pass.setBindGroup(0, group);
  pass.dispatchWorkgroups(width, height);
  pass.end();
  encoder.copyBufferToBuffer(made, 0, read, 0, size);
  device.queue.submit([encoder.finish()]);
  await read.mapAsync(GPUMapMode.READ);
  return new Float32Array(read.getMappedRange().slice(0));
}
window.render = async ({ width, height, seed }) => {
  const asked = new URLSearchParams(location.search);
  const pixels = await (asked.has("webgpu") ? webgpu : webgl)(width, height, seed);
  return { width, height, pixels, bottomUp: !asked.has("turned") };
};
</script>"""

SCENE = """
film: {width: 24, height: 16}
shapes: [{type: sphere, center: [0, 0, -3]}]
lights: [{type: constant, radiance: 1}]
"""


@pytest.mark.parametrize(
    ("two", "verdict", "cause"),
    [("webgpu", "agree", None), ("webgpu&turned", "differ", "upside down")],
)
def test_webgl_and_webgpu(two, verdict, cause, tmp_path, monkeypatch):
    """The same numbers of the same hash: paired, and half a thousandth would be seen."""
    monkeypatch.chdir(tmp_path)
    Path("page.html").write_text(PAGE, encoding="utf-8")
    Path("scene.yaml").write_text(SCENE, encoding="utf-8")
    pages = ("page.html?webgl", f"page.html?{two}")
    result, found = run("--pair", *pages, "--scene", "scene.yaml", "--seed", "7")
    assert found, result.output
    (case,) = found["cases"]
    assert case["verdict"] == verdict
    assert (case["cause"] or {}).get("name") == cause
    if cause is None:
        assert any(note.startswith("paired: ") for note in case["notes"])
