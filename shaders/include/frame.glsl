// The shading frame: +Y is the normal, directions point away from the surface, cos θ = w.y.
#ifndef FRAME_GLSL
#define FRAME_GLSL

struct Frame {
    vec3 tangent;
    vec3 normal;
    vec3 bitangent;
};

// An orthonormal frame about a unit normal, without branches (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
Frame frame_from_normal(vec3 n) {
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    return Frame(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), n, vec3(b, s + n.y * n.y * a, -n.y));
}

vec3 to_local(Frame f, vec3 w) { return vec3(dot(w, f.tangent), dot(w, f.normal), dot(w, f.bitangent)); }
vec3 to_world(Frame f, vec3 w) { return f.tangent * w.x + f.normal * w.y + f.bitangent * w.z; }

#endif
