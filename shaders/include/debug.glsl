// For whoever edits a shader under `sunfleck watch`. Everywhere else the macros are nothing, and the code is as if they were
// not written.
//   DEBUG_PIXEL(value);   the picture is this value: of each sample, where a path first comes to such a line; black if none does
//   DEBUG_PRINT(value);   prints the value, for the first sample of the pixel that is inspected
// `value` is a bool, int, uint or float, or a vector of them. Both stand where a statement may.
#ifndef DEBUG_GLSL
#define DEBUG_GLSL

#ifdef DEBUG_VIEW
vec3 debug_value = vec3(0.0);
bool debug_is_set = false;

void debug_pixel(vec3 value) {
    if (!debug_is_set) debug_value = value;
    debug_is_set = true;
}
void debug_pixel(vec4 value) { debug_pixel(value.xyz); }
void debug_pixel(vec2 value) { debug_pixel(vec3(value, 0.0)); }
void debug_pixel(float value) { debug_pixel(vec3(value)); }
void debug_pixel(bool value) { debug_pixel(vec3(value)); }
void debug_pixel(int value) { debug_pixel(vec3(value)); }
void debug_pixel(uint value) { debug_pixel(vec3(value)); }
void debug_pixel(ivec2 value) { debug_pixel(vec2(value)); }
void debug_pixel(uvec2 value) { debug_pixel(vec2(value)); }
void debug_pixel(bvec2 value) { debug_pixel(vec2(value)); }
void debug_pixel(ivec3 value) { debug_pixel(vec3(value)); }
void debug_pixel(uvec3 value) { debug_pixel(vec3(value)); }
void debug_pixel(bvec3 value) { debug_pixel(vec3(value)); }
void debug_pixel(ivec4 value) { debug_pixel(vec3(value.xyz)); }
void debug_pixel(uvec4 value) { debug_pixel(vec3(value.xyz)); }
void debug_pixel(bvec4 value) { debug_pixel(vec3(value.xyz)); }
#define DEBUG_PIXEL(value) debug_pixel(value)

// Once a sample has its value, nothing more is to come of its path.
#define SAMPLE_ENDS(condition) ((condition) || debug_is_set)
vec3 take_debug_value() {
    vec3 value = debug_is_set ? debug_value : vec3(0.0);
    debug_is_set = false;
    return value;
}
#else
#define DEBUG_PIXEL(value)
#define SAMPLE_ENDS(condition) (condition)
#endif

#ifdef DEBUG_PRINTS
// The kernel defines it: `header` is the number of the place, the kind and the number of components, 4 bits each of these.
void debug_write(uint header, uvec4 words);
const uint DEBUG_FLOAT = 0u;
const uint DEBUG_INT = 1u;
const uint DEBUG_UINT = 2u;
const uint DEBUG_BOOL = 3u;
void debug_record(uint place, uint kind, uint components, uvec4 words) {
    debug_write(place << 8u | kind << 4u | components, words);
}
void debug_print(uint place, float v) { debug_record(place, DEBUG_FLOAT, 1u, uvec4(floatBitsToUint(v))); }
void debug_print(uint place, vec2 v) { debug_record(place, DEBUG_FLOAT, 2u, floatBitsToUint(v).xyxy); }
void debug_print(uint place, vec3 v) { debug_record(place, DEBUG_FLOAT, 3u, floatBitsToUint(v).xyzz); }
void debug_print(uint place, vec4 v) { debug_record(place, DEBUG_FLOAT, 4u, floatBitsToUint(v)); }
void debug_print(uint place, int v) { debug_record(place, DEBUG_INT, 1u, uvec4(v)); }
void debug_print(uint place, ivec2 v) { debug_record(place, DEBUG_INT, 2u, uvec4(v.xyxy)); }
void debug_print(uint place, ivec3 v) { debug_record(place, DEBUG_INT, 3u, uvec4(v.xyzz)); }
void debug_print(uint place, ivec4 v) { debug_record(place, DEBUG_INT, 4u, uvec4(v)); }
void debug_print(uint place, uint v) { debug_record(place, DEBUG_UINT, 1u, uvec4(v)); }
void debug_print(uint place, uvec2 v) { debug_record(place, DEBUG_UINT, 2u, v.xyxy); }
void debug_print(uint place, uvec3 v) { debug_record(place, DEBUG_UINT, 3u, v.xyzz); }
void debug_print(uint place, uvec4 v) { debug_record(place, DEBUG_UINT, 4u, v); }
void debug_print(uint place, bool v) { debug_record(place, DEBUG_BOOL, 1u, uvec4(v)); }
void debug_print(uint place, bvec2 v) { debug_record(place, DEBUG_BOOL, 2u, uvec4(v.xyxy)); }
void debug_print(uint place, bvec3 v) { debug_record(place, DEBUG_BOOL, 3u, uvec4(v.xyzz)); }
void debug_print(uint place, bvec4 v) { debug_record(place, DEBUG_BOOL, 4u, uvec4(v)); }
// What `watch` writes for DEBUG_PRINT(value), so that the value's text and its line are known.
#define DEBUG_PRINT_AT(place, value) debug_print(place, value)
#endif
#define DEBUG_PRINT(value)

#endif
