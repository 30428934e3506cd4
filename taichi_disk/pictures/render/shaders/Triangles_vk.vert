#version 450

// Replaces the vertex shader of GGUI's canvas.triangles (Taichi 1.7.4), which leaves
// the normal of a vertex unused and ignores the opacity of its colour.
layout(location = 0) in vec3 in_position; // 0 to 1, y upwards
layout(location = 1) in vec3 in_normal; // darkness of the triangle's three sides
layout(location = 3) in vec4 in_color;

layout(binding = 0) uniform UniformBufferObject {
  vec3 color;
  int use_per_vertex_color;
} ubo;

layout(location = 0) out vec4 color;
layout(location = 1) out vec3 darkness;

void main() {
  gl_Position = vec4(2.0 * in_position.x - 1.0, 1.0 - 2.0 * in_position.y, 0.0, 1.0);
  color = ubo.use_per_vertex_color == 0 ? vec4(ubo.color, 1.0) : in_color;
  darkness = in_normal;
}
