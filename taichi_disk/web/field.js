// Draws triangles, springs and points by WebGL2. A new state uploads one texture: positions and values.

const WIDTH = 2048; // texels in a row of that texture
const VERTEX = `#version 300 es
precision highp float;
uniform highp sampler2D points; // x, y [R] and value of each point, then values of springs
uniform float factor; // pixels per R
uniform vec2 shift, size; // position of the origin, size of the canvas [px], y upwards
uniform highp int mark; // 0: triangle, 1: spring, 2: point
uniform highp int own; // where values of springs begin; 0: a spring has the mean of its ends
uniform float radius; // half the width of a spring or a point [px]
in uvec2 ends; // of a spring
out float value;
out vec2 away; // from the middle of a mark [px]

vec3 texel(int i) {
  return texelFetch(points, ivec2(i % ${WIDTH}, i / ${WIDTH}), 0).xyz * vec3(factor, factor, 1.0) + vec3(shift, 0.0);
}

void main() {
  vec2 corner = (radius + 1.0) * vec2((gl_VertexID & 1) * 2 - 1, (gl_VertexID & 2) - 1);
  vec3 a = texel(mark == 0 ? gl_VertexID : mark == 1 ? int(ends.x) : gl_InstanceID);
  value = a.z;
  away = mark == 0 ? vec2(0.0) : mark == 1 ? vec2(0.0, corner.y) : corner;
  if (mark == 1) {
    vec3 b = texel(int(ends.y));
    vec2 along = normalize(b.xy - a.xy + vec2(1e-9, 0.0));
    value = own > 0 ? texel(own + gl_InstanceID).z : 0.5 * (a.z + b.z);
    a.xy = (corner.x < 0.0 ? a.xy : b.xy) + corner.y * vec2(-along.y, along.x);
  }
  a.xy += mark == 2 ? corner : vec2(0.0);
  gl_Position = vec4(2.0 * a.xy / size - 1.0, 0.0, 1.0);
}`;
const FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D colours;
uniform vec2 scale; // from a value to its place in the colour map: factor and shift
uniform bool fringes;
uniform float ink; // opacity of black, which is drawn instead of the map's colour unless 0
uniform highp int mark;
uniform float radius;
in float value;
in vec2 away;
out vec4 colour;

void main() {
  float level = value * scale.x + scale.y;
  if (fringes) level = pow(sin(3.14159265 * level), 2.0);
  vec3 mapped = texture(colours, vec2(clamp(level, 0.0, 1.0) * (255.0 / 256.0) + 0.5 / 256.0, 0.5)).rgb;
  float covered = mark == 0 ? 1.0 : clamp(radius + 0.5 - length(away), 0.0, 1.0);
  colour = covered * (ink > 0.0 ? vec4(vec3(0.0), ink) : vec4(mapped, 1.0));
}`;

export class Field {
  constructor({ points, triangles, springs }) {
    this.canvas = document.createElement("canvas");
    const gl = (this.gl = this.canvas.getContext("webgl2", { antialias: false, depth: false }));
    if (!gl)
      throw new Error(
        "This browser has no WebGL 2, which draws the disk: update it, or allow acceleration.",
      );
    const program = gl.createProgram();
    for (const [kind, source] of [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    const failed = !gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost();
    if (failed) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    this.uniform = (kind, name, ...values) =>
      gl[`uniform${kind}`](gl.getUniformLocation(program, name), ...values);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.count = { points, springs: springs.length / 2, corners: triangles.length };
    this.texels = new Float32Array(4 * WIDTH * Math.ceil((points + this.count.springs) / WIDTH));
    for (const [unit, filter] of [
      [gl.TEXTURE0, gl.NEAREST],
      [gl.TEXTURE1, gl.LINEAR],
    ]) {
      gl.activeTexture(unit);
      gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    }
    this.uniform("1i", "colours", 1);
    for (const [target, data] of [
      [gl.ELEMENT_ARRAY_BUFFER, triangles],
      [gl.ARRAY_BUFFER, springs],
    ]) {
      gl.bindBuffer(target, gl.createBuffer());
      gl.bufferData(target, data, gl.STATIC_DRAW);
    }
    const ends = gl.getAttribLocation(program, "ends");
    gl.enableVertexAttribArray(ends);
    gl.vertexAttribIPointer(ends, 2, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(ends, 1);
  }

  // positions (2n) [R]; values (n), or one for each spring; marks: what to draw, in order, as {mark, radius, ink};
  // colours: 256 x 3 bytes; factor, shift, scale and fringes are the shaders' uniforms.
  draw(width, height, { positions, values, marks, colours, factor, shift, scale, fringes }) {
    const { gl, texels, canvas, count } = this,
      own = values.length === count.points ? 0 : count.points;
    if (canvas.width !== width || canvas.height !== height)
      Object.assign(canvas, { width, height });
    for (let i = 0; i < count.points; i++) {
      texels[4 * i] = positions[2 * i];
      texels[4 * i + 1] = positions[2 * i + 1];
    }
    values.forEach((value, i) => (texels[4 * (own + i) + 2] = value));
    gl.activeTexture(gl.TEXTURE0);
    gl.texImage2D(
      gl.TEXTURE_2D,
      0,
      gl.RGBA32F,
      WIDTH,
      texels.length / WIDTH / 4,
      0,
      gl.RGBA,
      gl.FLOAT,
      texels,
    );
    gl.activeTexture(gl.TEXTURE1);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, colours);
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.uniform("1f", "factor", factor);
    this.uniform("2fv", "shift", shift);
    this.uniform("2f", "size", width, height);
    this.uniform("2fv", "scale", scale);
    this.uniform("1i", "fringes", fringes);
    this.uniform("1i", "own", own);
    for (const { mark, radius = 0, ink = 0 } of marks) {
      this.uniform("1i", "mark", mark);
      this.uniform("1f", "radius", radius);
      this.uniform("1f", "ink", ink);
      if (mark === 0) gl.drawElements(gl.TRIANGLES, count.corners, gl.UNSIGNED_INT, 0);
      else
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, mark === 1 ? count.springs : count.points);
    }
    return canvas;
  }
}
