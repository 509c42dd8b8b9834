// A value per leaf; backs are black.

layout(std430, binding = 1) readonly buffer Leaves { int leaf[]; };     // by triangle
layout(std430, binding = 2) readonly buffer Values { float value[]; };  // three by leaf

uniform int first_triangle;  // of what is drawn at once

flat in int is_front;

layout(location = 0) out vec4 colour;

void main() {
    int at = 3 * leaf[first_triangle + gl_PrimitiveID];
    colour = vec4(value[at], value[at + 1], value[at + 2], 1.0) * float(is_front);
}
