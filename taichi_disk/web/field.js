// Triangles, springs and points, drawn by WebGL2. All take positions and values from one texture, which is all that a
// new state has to upload.

const WIDTH = 1024; // points in a row of that texture
const VERTEX = `#version 300 es
precision highp float;
precision highp int;
uniform highp sampler2D points; // x, y [R] and value of each point
uniform vec2 factor, shift, size; // from R to pixels, y upwards; of the canvas [px]
uniform int mark; // 0: triangle, 1: spring, 2: point
uniform float radius; // half the width of a spring or a point [px]
in uvec2 ends;
in float own; // value of a spring; below -1e29: the mean of its ends
out float value;
out vec2 away; // from the middle of a mark [px]

vec3 point(uint i) {
  vec3 p = texelFetch(points, ivec2(i % ${WIDTH}u, i / ${WIDTH}u), 0).xyz;
  return vec3(factor * p.xy + shift, p.z);
}

void main() {
  vec2 corner = (radius + 1.0) * vec2((gl_VertexID & 1) * 2 - 1, (gl_VertexID & 2) - 1);
  vec3 a = point(mark == 0 ? uint(gl_VertexID) : mark == 1 ? ends.x : uint(gl_InstanceID));
  value = a.z;
  away = vec2(0.0);
  if (mark == 1) {
    vec3 b = point(ends.y);
    vec2 along = normalize(b.xy - a.xy + vec2(1e-9, 0.0));
    away = vec2(0.0, corner.y);
    value = own > -1e29 ? own : 0.5 * (a.z + b.z);
    a.xy = (corner.x < 0.0 ? a.xy : b.xy) + corner.y * vec2(-along.y, along.x);
  } else if (mark == 2) {
    away = corner;
    a.xy += corner;
  }
  gl_Position = vec4(2.0 * a.xy / size - 1.0, 0.0, 1.0);
}`;
const FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
uniform sampler2D colours;
uniform vec2 scale; // from a value to its place in the map: factor and shift
uniform bool fringes;
uniform vec4 ink; // instead of the map's colour, where its last number is not 0
uniform int mark;
uniform float radius;
in float value;
in vec2 away;
out vec4 colour;

void main() {
  float level = value * scale.x + scale.y;
  if (fringes) level = pow(sin(3.14159265 * level), 2.0);
  vec3 shown = texture(colours, vec2(clamp(level, 0.0, 1.0) * (255.0 / 256.0) + 0.5 / 256.0, 0.5)).rgb;
  float covered = mark == 0 ? 1.0 : clamp(radius + 0.5 - length(away), 0.0, 1.0);
  colour = ink.a > 0.0 ? vec4(ink.rgb * ink.a, ink.a) * covered : vec4(shown, 1.0) * covered;
}`;

export class Field {
  constructor(scene) {
    this.canvas = document.createElement("canvas");
    const gl = (this.gl = this.canvas.getContext("webgl2", { antialias: false, depth: false }));
    if (!gl) throw new Error("This browser has no WebGL 2, which draws the disk: update it, or allow hardware acceleration.");
    const program = (this.program = gl.createProgram());
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    this.uniforms = {};
    for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k++) {
      const { name } = gl.getActiveUniform(program, k);
      this.uniforms[name] = gl.getUniformLocation(program, name);
    }
    gl.uniform1i(this.uniforms.colours, 1);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    this.count = { points: scene.points, springs: scene.springs.length / 2, corners: scene.triangles.length };
    this.texels = new Float32Array(4 * WIDTH * Math.ceil(scene.points / WIDTH));
    [gl.TEXTURE0, gl.TEXTURE1].forEach((unit, k) => {
      gl.activeTexture(unit);
      gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
      const filter = k ? gl.LINEAR : gl.NEAREST;
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, scene.triangles, gl.STATIC_DRAW);
    const ends = gl.getAttribLocation(program, "ends");
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, scene.springs, gl.STATIC_DRAW);
    gl.vertexAttribIPointer(ends, 2, gl.UNSIGNED_INT, 0, 0);
    this.own = gl.getAttribLocation(program, "own");
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.vertexAttribPointer(this.own, 1, gl.FLOAT, false, 0, 0);
    for (const one of [ends, this.own]) gl.vertexAttribDivisor(one, 1);
    this.ends = ends;
  }

  get lost() {
    return this.gl.isContextLost();
  }

  // positions (2n) [R]; values (n), or one for each spring; to pixels by factor and shift; `marks`: what to draw, in
  // order, as {mark, radius, ink}; colours: 256 x 3 bytes; scale: from values to places in it.
  draw(width, height, { positions, values, factor, shift, marks, colours, scale, fringes }) {
    const { gl, uniforms, texels, canvas, count } = this;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const each = values.length === count.springs && values.length !== count.points;
    for (let i = 0; i < count.points; i++) {
      texels[4 * i] = positions[2 * i];
      texels[4 * i + 1] = positions[2 * i + 1];
      texels[4 * i + 2] = each ? 0 : values[i];
    }
    gl.activeTexture(gl.TEXTURE0);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, WIDTH, texels.length / WIDTH / 4, 0, gl.RGBA, gl.FLOAT, texels);
    gl.activeTexture(gl.TEXTURE1);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, colours);
    if (each) gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.uniform2f(uniforms.factor, factor, factor);
    gl.uniform2fv(uniforms.shift, shift);
    gl.uniform2f(uniforms.size, width, height);
    gl.uniform2fv(uniforms.scale, scale);
    gl.uniform1i(uniforms.fringes, fringes);
    for (const { mark, radius = 0, ink = [0, 0, 0, 0] } of marks) {
      gl.uniform1i(uniforms.mark, mark);
      gl.uniform1f(uniforms.radius, radius);
      gl.uniform4fv(uniforms.ink, ink);
      const springs = mark === 1;
      gl[springs ? "enableVertexAttribArray" : "disableVertexAttribArray"](this.ends);
      gl[springs && each ? "enableVertexAttribArray" : "disableVertexAttribArray"](this.own);
      gl.vertexAttrib1f(this.own, -1e30);
      gl.vertexAttribI4ui(this.ends, 0, 0, 0, 0);
      if (mark === 0) gl.drawElements(gl.TRIANGLES, count.corners, gl.UNSIGNED_INT, 0);
      else gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, springs ? count.springs : count.points);
    }
    return canvas;
  }
}
