/**
 * libbtf: packed BTF assets (.spmm, docs/reference/format.md) for programs in C, C++ and whatever calls C.
 *
 * Build and link
 *
 *     cargo build --release --package btf-runtime-c
 *     cc -std=c99 -Iruntime/c/include program.c target/release/libbtf.a -lpthread -ldl -lm     (static)
 *     cc -std=c99 -Iruntime/c/include program.c -Ltarget/release -lbtf                         (shared)
 *
 * On Windows link btf.lib, or btf.dll.lib and ship btf.dll.
 *
 * Evaluate (runtime/c/examples/evaluate.c is a whole program)
 *
 *     btf_asset *asset;
 *     if (btf_open_file("leaf.spmm", NULL, &asset) != BTF_OK) {
 *         fprintf(stderr, "%s\n", btf_last_error());
 *         return 1;
 *     }
 *     btf_place place = {{0.25f, 0.75f}, {0.0f, 0.0f, 1.0f}, {0.6f, 0.0f, 0.8f}};
 *     float rgb[3];
 *     btf_evaluate(asset, 0, &place, NULL, rgb);
 *     btf_close(asset);
 *
 * Values are pi x BRDF x |cosine of the light|, linear RGB: 1 is a white Lambertian lit at normal
 * incidence. Radiance towards the eye is (irradiance at normal incidence) x value / pi, and of a point light
 * intensity / distance^2 x visibility x value / pi. Multiply no further cosine.
 *
 * Upload to a GPU: btf_resident gives the words of one storage buffer, which the WGSL decoder reads as they are;
 * `cargo xtask shaders` writes that decoder as btf.wgsl.
 *
 * Rules of all calls
 *
 * - A call returns BTF_OK, or a code if it did nothing; btf_last_error() then has the reason in a sentence. No call exits or
 *   changes global state.
 * - Pointers are checked for null and alignment; that memory of the stated size lies behind them is up to the caller.
 *   Numbers may be anything: those out of range are BTF_ARGUMENT, or black where a call says so.
 * - One handle may be read by any number of threads at once; only btf_close must be alone.
 * - Equal arguments give equal bits, on any thread.
 * - Hostile files are refused, never read beyond their end. Where memory runs out the process ends, as Rust's do.
 */


#ifndef BTF_H
#define BTF_H

/* Written by `cargo xtask header` from runtime/c/src; edit there. */

#include <stddef.h>
#include <stdint.h>

/**
 * Light and eye in front of the surface: reflection. A bit of btf_info.sides.
 */
#define BTF_FRONT_LIT_FRONT 1

/**
 * Light behind the surface, eye in front: transmission. A bit of btf_info.sides.
 */
#define BTF_FRONT_LIT_BACK 2

/**
 * Light in front of the surface, eye behind: transmission. A bit of btf_info.sides.
 */
#define BTF_BACK_LIT_FRONT 4

/**
 * Light and eye behind the surface: reflection of its back. A bit of btf_info.sides.
 */
#define BTF_BACK_LIT_BACK 8

/**
 * The code that every call returns: 0, or the reason why the call did nothing. btf_last_error() has the full sentence.
 */
enum btf_code
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * The call succeeded.
   */
  BTF_OK = 0,
  /**
   * A pointer is null or not aligned for its type.
   */
  BTF_POINTER = 1,
  /**
   * A number is out of its range: a level, a count, an option.
   */
  BTF_ARGUMENT = 2,
  /**
   * The file cannot be read.
   */
  BTF_FILE = 3,
  /**
   * The bytes are no asset: they do not begin with "SPMM".
   */
  BTF_NOT_AN_ASSET = 4,
  /**
   * The asset is of a version that this library does not read.
   */
  BTF_VERSION = 5,
  /**
   * The bytes end too early, or go on behind the end of the asset.
   */
  BTF_LENGTH = 6,
  /**
   * A checksum does not match: the bytes were changed in transit.
   */
  BTF_DAMAGED = 7,
  /**
   * The bytes break another rule of docs/reference/format.md.
   */
  BTF_INVALID = 8,
  /**
   * A mistake of this library. The handle may be used further; please report the sentence.
   */
  BTF_INTERNAL = 9,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum btf_code btf_code;
#else
typedef int32_t btf_code;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The levels with which an asset is opened. A level is half as wide and high as the one before, for places where a
 * pixel covers several texels.
 */
enum btf_levels
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * The levels that the file has.
   */
  BTF_LEVELS_AT_HAND = 0,
  /**
   * All levels down to a single texel. Missing ones are made, which takes seconds for large assets.
   */
  BTF_LEVELS_ALL = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum btf_levels btf_levels;
#else
typedef uint32_t btf_levels;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The rule by which a value between the measured directions is computed from theirs.
 */
enum btf_interpolation
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Evaluates the lobes in the asked directions and interpolates the residual: one evaluation of the lobes.
   */
  BTF_INTERPOLATION_FAST = 0,
  /**
   * Scales the nine measured values around by the lobes: smoother between sparse directions, nine times the cost of
   * the lobes.
   */
  BTF_INTERPOLATION_EXACT = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum btf_interpolation btf_interpolation;
#else
typedef uint32_t btf_interpolation;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The use of an asset's heights.
 */
enum btf_heights
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Ignores them.
   */
  BTF_HEIGHTS_NONE = 0,
  /**
   * Removes the parallax of eyes outside the measured ones.
   */
  BTF_HEIGHTS_PARALLAX = 1,
  /**
   * Also corrects what is interpolated between the measured directions; fast interpolation only.
   */
  BTF_HEIGHTS_RELIEF = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum btf_heights btf_heights;
#else
typedef uint32_t btf_heights;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * An open asset. A call only reads what the handle points to, so any number of threads may use one handle at once, in
 * all calls but btf_close.
 */
typedef struct btf_asset btf_asset;

/**
 * Options of opening an asset.
 */
typedef struct btf_open_options {
  /**
   * Levels: a btf_levels.
   */
  uint32_t levels;
  /**
   * Number of threads that opening may use, all gone when it returns; 0 for as many as there are processors.
   */
  uint32_t threads;
} btf_open_options;

/**
 * Properties of an asset.
 */
typedef struct btf_info {
  /**
   * Version of the file's format.
   */
  uint32_t format_version;
  /**
   * Number of texels in a row of the finest level.
   */
  uint32_t width;
  /**
   * Number of rows of the finest level.
   */
  uint32_t height;
  /**
   * Number of layers, 1 to 4: one for each pair of sides below.
   */
  uint32_t layers;
  /**
   * Number of levels, the finest included.
   */
  uint32_t levels;
  /**
   * Largest number of residual components that a layer has; 0 without residual.
   */
  uint32_t components;
  /**
   * Largest number of lobes that a texel has.
   */
  uint32_t lobes;
  /**
   * Sides of eye and light for which the asset has a layer: bits BTF_FRONT_LIT_FRONT to BTF_BACK_LIT_BACK. Other
   * pairs of sides are black.
   */
  uint32_t sides;
  /**
   * Bit 0: the left edge continues the right one; bit 1: the bottom edge continues the top one.
   */
  uint32_t seamless;
  /**
   * Physical width in millimetres; 0 with the height where it is not known.
   */
  float width_mm;
  /**
   * Physical height in millimetres.
   */
  float height_mm;
} btf_info;

/**
 * Options of an evaluation, from fast to exact. At the measured directions interpolation and heights change nothing.
 */
typedef struct btf_options {
  /**
   * Largest number of residual components that are used; UINT32_MAX for all, 0 for the residual's mean alone.
   */
  uint32_t components;
  /**
   * Largest number of lobes of a texel that are used; UINT32_MAX for all.
   */
  uint32_t lobes;
  /**
   * Interpolation: a btf_interpolation.
   */
  uint32_t interpolation;
  /**
   * Use of the heights, where the asset has any: a btf_heights.
   */
  uint32_t heights;
} btf_options;

/**
 * A place of the surface with a light and an eye.
 */
typedef struct btf_place {
  /**
   * Texture coordinate: u to the right, v up, one repetition of the asset a unit.
   */
  float uv[2];
  /**
   * Unit vector to the light, in the frame of tangent (along u), bitangent (along v) and normal; z < 0 is behind the
   * surface. Its length may be off by half a percent.
   */
  float wi[3];
  /**
   * Unit vector to the eye, in the frame of wi. Its length may be off by half a percent.
   */
  float wo[3];
} btf_place;

/**
 * A direction that btf_sample has drawn, with its density and value.
 */
typedef struct btf_drawn {
  /**
   * Unit vector to the light.
   */
  float wi[3];
  /**
   * Probability density, per steradian. 0: nothing was drawn, the path ends, and all else is 0 too.
   */
  float density;
  /**
   * Value of btf_evaluate for a light in this direction.
   */
  float value[3];
} btf_drawn;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Returns a few words for an error code, for example "the asset is damaged". `code` may be any number. The result is
 * never null, belongs to the library and stays for ever.
 */
const char *btf_error_text(int32_t code);

/**
 * Returns the sentence of the last call of this thread that failed: the fault and the remedy. Calls that succeed leave
 * it. The text is empty where no call has failed, and never null; it belongs to the library and stays until the next
 * call of this thread that fails, or the thread's end.
 */
const char *btf_last_error(void);

/**
 * Returns the options that null stands for: levels of the file, all processors.
 */
struct btf_open_options btf_default_open_options(void);

/**
 * Opens an asset that lies in memory: checks it, and expands it to the form that is evaluated.
 *
 * `bytes`, `length`: the whole `.spmm` file, or a prefix that ends where a tier does; not needed afterwards.
 * `options`: null for btf_default_open_options().
 * `asset`: receives the handle, which the caller owns and gives to btf_close; null where the call fails.
 * Errors: BTF_POINTER, BTF_ARGUMENT, and BTF_NOT_AN_ASSET to BTF_INVALID.
 */
btf_code btf_open_memory(const uint8_t *bytes,
                         size_t length,
                         const struct btf_open_options *options,
                         struct btf_asset **asset);

/**
 * Opens an asset file, like btf_open_memory. A resident form is mapped, not read: it must not be changed in place
 * until the asset is closed. A file form is not needed afterwards.
 *
 * `path`: text that ends with a zero; UTF-8, on Unix any bytes.
 * Errors: those of btf_open_memory, and BTF_FILE. The sentence of btf_last_error() begins with the path.
 */
btf_code btf_open_file(const char *path,
                       const struct btf_open_options *options,
                       struct btf_asset **asset);

/**
 * Closes an asset and frees all that belongs to it. Null does nothing. No other call may be using the handle, and none
 * may use it afterwards.
 */
void btf_close(struct btf_asset *asset);

/**
 * Returns the properties of an asset.
 *
 * `info`: receives the properties.
 * Errors: BTF_POINTER.
 */
btf_code btf_query(const struct btf_asset *asset, struct btf_info *info);

/**
 * Returns the description of an asset: JSON, UTF-8, with its name and origin.
 *
 * `text`: receives a pointer to the description, which belongs to the asset and stays until btf_close. A zero follows
 * the text.
 * `length`: receives the number of bytes without that zero; may be null.
 * Errors: BTF_POINTER.
 */
btf_code btf_material(const struct btf_asset *asset,
                      const char **text,
                      size_t *length);

/**
 * Returns the wavelengths of an asset's bands in nanometres, ascending.
 *
 * `wavelengths_nm`: receives a pointer to them, which belongs to the asset and stays until btf_close; null for an asset of
 * colours.
 * `count`: receives their number; 0 for an asset of colours.
 * Errors: BTF_POINTER.
 */
btf_code btf_bands(const struct btf_asset *asset,
                   const float **wavelengths_nm,
                   size_t *count);

/**
 * Makes a second handle of an asset in bands whose values are other sums of them than linear sRGB under D65: colours under
 * another light, what a camera sees, or three of the bands. The caller gives both to btf_close.
 *
 * `weights`: 3 x `count` numbers, for each band of btf_bands the weights in the three values.
 * `count`: number of bands; must be that of the asset.
 * `shown`: receives the handle; null where the call fails.
 * Errors: BTF_POINTER, BTF_ARGUMENT.
 */
btf_code btf_show_bands(const struct btf_asset *asset,
                        const float *weights,
                        size_t count,
                        struct btf_asset **shown);

/**
 * Returns an asset as the words of one storage buffer, for the WGSL decoder (`cargo xtask shaders` writes it as
 * btf.wgsl): all levels and layers, with offsets in words from the first, so that several assets may lie in one
 * buffer.
 *
 * `words`: receives a pointer to the words, which belongs to the asset and stays until btf_close.
 * `count`: receives their number; a word has 4 bytes, in the machine's order.
 * Errors: BTF_POINTER.
 */
btf_code btf_resident(const struct btf_asset *asset,
                      const uint32_t **words,
                      size_t *count);

/**
 * Returns the options that null stands for: all components and lobes, fast interpolation, heights for parallax and relief.
 */
struct btf_options btf_default_options(void);

/**
 * Evaluates one place: pi x BRDF x |cosine of wi|, linear RGB, at least 0 and finite. With light and eye on different
 * sides it is the BTDF. A white Lambertian surface lit at normal incidence gives 1; the cosine is inside, so a
 * renderer multiplies by irradiance at normal incidence / pi, and by no further cosine.
 *
 * `level`: 0 the finest, below btf_info.levels. The texel nearest to uv is evaluated.
 * `place`: texture coordinate, light and eye. The value is black where the asset has no layer for these sides, where a
 * number is not finite, and where wi or wo is not of length 1 within half a percent.
 * `options`: null for btf_default_options().
 * `value`: receives 3 numbers.
 * Errors: BTF_POINTER, BTF_ARGUMENT.
 */
btf_code btf_evaluate(const struct btf_asset *asset,
                      uint32_t level,
                      const struct btf_place *place,
                      const struct btf_options *options,
                      float *value);

/**
 * Evaluates the bands of one place of an asset that has any, as btf_evaluate does its colours, each at least 0.
 *
 * `values`: receives a number for each wavelength of btf_bands.
 * `count`: room in `values`; must be the number of bands.
 * Errors: BTF_POINTER, BTF_ARGUMENT.
 */
btf_code btf_evaluate_bands(const struct btf_asset *asset,
                            uint32_t level,
                            const struct btf_place *place,
                            const struct btf_options *options,
                            float *values,
                            size_t count);

/**
 * Evaluates many places, each like btf_evaluate, on the calling thread. Several threads may share the work: give each
 * a part of the arrays.
 *
 * `places`: `count` of them; `count` may be 0, and then no array is read.
 * `values`: receives 3 x `count` numbers, red, green and blue of each place. Untouched where the call fails.
 * Errors: BTF_POINTER, BTF_ARGUMENT.
 */
btf_code btf_evaluate_many(const struct btf_asset *asset,
                           uint32_t level,
                           const struct btf_place *places,
                           size_t count,
                           const struct btf_options *options,
                           float *values);

/**
 * Draws a direction to light that matters to an eye: by the lobes, and a share by the cosine. Where the eye sees light
 * from both sides, either has the same probability. value / (pi x density) is the weight of a path that continues in
 * the direction.
 *
 * `level`: as for btf_evaluate.
 * `uv`: 2 numbers, `wo`: 3 numbers, as in btf_place.
 * `at`: 3 numbers, each 0 to 1, 1 not included: random, or of a low-discrepancy sequence.
 * `options`: null for btf_default_options().
 * `drawn`: receives the direction. Its density is 0 where nothing was drawn, which is no error.
 * Errors: BTF_POINTER, BTF_ARGUMENT.
 */
btf_code btf_sample(const struct btf_asset *asset,
                    uint32_t level,
                    const float *uv,
                    const float *wo,
                    const float *at,
                    const struct btf_options *options,
                    struct btf_drawn *drawn);

/**
 * Draws one of the four texels around a texture coordinate: with evenly spread numbers the mean of their values is
 * their bilinear interpolation, so that an asset whose texels are larger than pixels looks smooth. Give btf_evaluate,
 * btf_sample and btf_density of one vertex of a path the coordinate that this returns in place of the vertex's own.
 *
 * `level`: as for btf_evaluate.
 * `uv`: 2 numbers, as in btf_place.
 * `at`: 2 numbers, each 0 to 1, 1 not included: random, or of a low-discrepancy sequence; 0.5 twice for the nearest
 * texel.
 * `between`: receives 2 numbers, the middle of the texel, from 0 to 1.
 * Errors: BTF_POINTER, BTF_ARGUMENT.
 */
btf_code btf_uv_between(const struct btf_asset *asset,
                        uint32_t level,
                        const float *uv,
                        const float *at,
                        float *between);

/**
 * Returns the density with which btf_sample draws the light's direction of a place, per steradian; 0 where it never
 * does.
 *
 * `level`, `place`: as for btf_evaluate. `options`: those that btf_sample had.
 * `density`: receives 1 number.
 * Errors: BTF_POINTER, BTF_ARGUMENT.
 */
btf_code btf_density(const struct btf_asset *asset,
                     uint32_t level,
                     const struct btf_place *place,
                     const struct btf_options *options,
                     float *density);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* BTF_H */
