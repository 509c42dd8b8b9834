// One more than the triangle: 0 is nothing.

layout(location = 0) out uint identity;

void main() {
    identity = uint(gl_PrimitiveID) + 1u;
}
