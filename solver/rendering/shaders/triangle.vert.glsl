// Geometry alone; what a fragment is follows from its triangle.

in vec3 position;
in int patch_index;

flat out int is_front;

void main() {
    gl_Position = project(position, patch_index);
    is_front = facing[patch_index] == 0 ? 1 : 0;
}
