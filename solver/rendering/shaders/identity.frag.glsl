// One more than the triangle: 0 is nothing. The highest bit marks a back.

flat in int is_front;

layout(location = 0) out uint identity;

void main() {
    identity = (uint(gl_PrimitiveID) + 1u) | (is_front != 0 ? 0u : 0x80000000u);
}
