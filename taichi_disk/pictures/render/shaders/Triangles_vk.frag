#version 450

// The darkness of a side is greatest on the side, falls linearly with the distance
// from it, and is negative at the opposite corner: the side is an antialiased line.
layout(location = 0) in vec4 color;
layout(location = 1) in vec3 darkness;

layout(location = 0) out vec4 out_color;

void main() {
  float ink = max(max(darkness.x, darkness.y), max(darkness.z, 0.0));
  out_color = vec4((1.0 - ink) * color.rgb, color.a);
}
