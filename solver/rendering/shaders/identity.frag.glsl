// One more than the triangle: 0 is nothing. The highest bit marks a back.

uniform int first_triangle;  // of what is drawn at once

flat in int is_front;

layout(location = 0) out uint identity;

void main() {
    identity = (uint(first_triangle + gl_PrimitiveID) + 1u) | (is_front != 0 ? 0u : 0x80000000u);
}
