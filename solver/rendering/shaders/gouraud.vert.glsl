// A value per vertex, interpolated over triangles; backs are black.

in vec3 position;
in int patch_index;
in vec3 value;

out vec3 shade;

void main() {
    gl_Position = project(position, patch_index);
    shade = facing[patch_index] == 0 ? value : vec3(0.0);
}
