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
 * Upload to a GPU: btf_resident gives the words of one storage buffer, which the WGSL decoder of runtime/src/shaders
 * reads as they are.
 *
 * Rules of all calls
 *
 * - A call returns BTF_OK or says why it did nothing; btf_last_error() then has the sentence. No call exits or
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
 * What every call returns: 0, or why it did nothing. btf_last_error() has the sentence that says what exactly.
 */
enum btf_code
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Done.
   */
  BTF_OK = 0,
  /**
   * A pointer is null or not aligned as its type asks for.
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
   * The bytes end too early, or go on where they should end.
   */
  BTF_LENGTH = 6,
  /**
   * A checksum does not match: the bytes were changed on their way.
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
 * Which levels an asset is opened with. A level is half as wide and high as the one before, for places that show
 * several texels in a pixel.
 */
enum btf_levels
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Those that the file has.
   */
  BTF_LEVELS_AT_HAND = 0,
  /**
   * All down to a single texel; those that the file has not are made, which takes seconds for large assets.
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
 * How a value between the measured directions is made of theirs.
 */
enum btf_interpolation
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * The lobes in the asked directions, the residual interpolated: one evaluation of the lobes.
   */
  BTF_INTERPOLATION_FAST = 0,
  /**
   * The nine measured values around, scaled by the lobes: smoother between sparse directions, nine times the
   * lobes' cost.
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
 * An open asset. What it points to is only read, so any number of threads may use one handle at once, in all calls but
 * btf_close.
 */
typedef struct btf_asset btf_asset;

/**
 * How an asset is opened.
 */
typedef struct btf_open_options {
  /**
   * A btf_levels.
   */
  uint32_t levels;
  /**
   * Threads that opening may use, all gone when it returns; 0 for as many as there are processors.
   */
  uint32_t threads;
} btf_open_options;

/**
 * What an asset has.
 */
typedef struct btf_info {
  /**
   * Version of the format that the file is in.
   */
  uint32_t format_version;
  /**
   * Texels per row of the finest level.
   */
  uint32_t width;
  /**
   * Rows of the finest level.
   */
  uint32_t height;
  /**
   * Layers, 1 to 4: one for each pair of sides below.
   */
  uint32_t layers;
  /**
   * Levels, the finest included.
   */
  uint32_t levels;
  /**
   * Residual components of the layer that has most; 0 where there is no residual.
   */
  uint32_t components;
  /**
   * Lobes of the texel that has most.
   */
  uint32_t lobes;
  /**
   * Which sides eye and light may be on: bits BTF_FRONT_LIT_FRONT to BTF_BACK_LIT_BACK. With others it is black.
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
 * How exactly to evaluate. At the measured directions interpolation and parallax change nothing.
 */
typedef struct btf_options {
  /**
   * Residual components at most; UINT32_MAX for all, 0 for the residual's mean alone.
   */
  uint32_t components;
  /**
   * Lobes of a texel at most; UINT32_MAX for all.
   */
  uint32_t lobes;
  /**
   * A btf_interpolation.
   */
  uint32_t interpolation;
  /**
   * 1: parallax of eyes outside the measured ones is removed where the asset has heights. 0: it is left.
   */
  uint32_t parallax;
} btf_options;

/**
 * A place of the surface, a light and an eye.
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
   * Unit vector to the eye, likewise.
   */
  float wo[3];
} btf_place;

/**
 * A direction that btf_sample has drawn.
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
   * What btf_evaluate gives in this direction.
   */
  float value[3];
} btf_drawn;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * A few words for an error code, for example "the asset is damaged". `code` may be any number.
 * Never null; belongs to the library and stays for ever.
 */
const char *btf_error_text(int32_t code);

/**
 * The sentence of the last call of this thread that failed: what was wrong, and the remedy. Calls that succeed leave
 * it. Empty where none has failed. Never null; belongs to the library and stays until the next call of this thread
 * that fails, or the thread's end.
 */
const char *btf_last_error(void);

/**
 * The options that null stands for: levels at hand, all processors.
 */
struct btf_open_options btf_default_open_options(void);

/**
 * Opens an asset that lies in memory: checks it, and expands it to the form that is evaluated.
 *
 * `bytes`, `length`: the whole `.spmm` file, or a prefix that ends where a tier does; not needed afterwards.
 * `options`: null for btf_default_open_options().
 * `asset`: takes the handle, which the caller owns and gives to btf_close; null where the call fails.
 * Errors: BTF_POINTER, BTF_ARGUMENT, and BTF_NOT_AN_ASSET to BTF_INVALID.
 */
btf_code btf_open_memory(const uint8_t *bytes,
                         size_t length,
                         const struct btf_open_options *options,
                         struct btf_asset **asset);

/**
 * Opens an asset file, as btf_open_memory does. One in its resident form is mapped, not read: it must not be changed in
 * place until the asset is closed. A file form is not needed afterwards.
 *
 * `path`: text that ends with a zero; UTF-8, on Unix any bytes.
 * Errors: those of btf_open_memory, and BTF_FILE. The sentence of btf_last_error() begins with the path.
 */
btf_code btf_open_file(const char *path,
                       const struct btf_open_options *options,
                       struct btf_asset **asset);

/**
 * Closes an asset and frees all that belongs to it. Null does nothing. No other call may be using the handle, and
 * none may use it afterwards.
 */
void btf_close(struct btf_asset *asset);

/**
 * Says what an asset has.
 *
 * `info`: takes the answer.
 * Errors: BTF_POINTER.
 */
btf_code btf_query(const struct btf_asset *asset, struct btf_info *info);

/**
 * The asset's description: JSON, UTF-8, with its name and origin.
 *
 * `text`: takes a pointer to it, which belongs to the asset and stays until btf_close. A zero follows the text.
 * `length`: takes its bytes, that zero not counted; null where nobody asks.
 * Errors: BTF_POINTER.
 */
btf_code btf_material(const struct btf_asset *asset,
                      const char **text,
                      size_t *length);

/**
 * The asset as the words of one storage buffer, for the WGSL decoder (runtime/src/shaders): all levels and layers,
 * offsets in words from the first, so that several assets may lie in one buffer.
 *
 * `words`: takes a pointer to them, which belongs to the asset and stays until btf_close.
 * `count`: takes their number; a word has 4 bytes, in the machine's order.
 * Errors: BTF_POINTER.
 */
btf_code btf_resident(const struct btf_asset *asset,
                      const uint32_t **words,
                      size_t *count);

/**
 * The options that null stands for: all components and lobes, fast interpolation, parallax removed.
 */
struct btf_options btf_default_options(void);

/**
 * Evaluates one place: pi x BRDF x |cosine of wi|, linear RGB, at least 0 and finite. With light and eye on
 * different sides it is the BTDF. A white Lambertian lit at normal incidence gives 1; the cosine is inside, so a
 * renderer multiplies irradiance at normal incidence / pi, and no further cosine.
 *
 * `level`: 0 the finest, below btf_info.levels. The texel nearest to uv answers.
 * `place`: where, lit from where, seen from where. Black where the asset has no layer for these sides, where a
 * number is not finite, and where wi or wo is not of length 1 within half a percent.
 * `options`: null for btf_default_options().
 * `value`: takes 3 numbers.
 * Errors: BTF_POINTER, BTF_ARGUMENT.
 */
btf_code btf_evaluate(const struct btf_asset *asset,
                      uint32_t level,
                      const struct btf_place *place,
                      const struct btf_options *options,
                      float *value);

/**
 * Evaluates many places, as btf_evaluate does one, on the calling thread. Several threads may share the work: give
 * each a part of the arrays.
 *
 * `places`: `count` of them; `count` may be 0, and then no array is looked at.
 * `values`: takes 3 x `count` numbers, red, green and blue of each place. Untouched where the call fails.
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
 * from both sides, either is as likely. value / (pi x density) is the weight of a path that goes on there.
 *
 * `level`: as btf_evaluate.
 * `uv`: 2 numbers, `wo`: 3 numbers, as in btf_place.
 * `at`: 3 numbers, each 0 to 1, 1 not included: random, or of a low-discrepancy sequence.
 * `options`: null for btf_default_options().
 * `drawn`: takes the direction. Its density is 0 where nothing was drawn, which is no error.
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
 * The density with which btf_sample draws the light's direction of a place, per steradian; 0 where it never does.
 *
 * `level`, `place`, `options`: as btf_evaluate; the same options as btf_sample had.
 * `density`: takes 1 number.
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
