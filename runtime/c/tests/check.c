/* The test program of the C interface, built and run by c_programs.rs.
 *
 *     check ASSET EXPECTED DAMAGED   everything below; the exit code is 1 where anything fails
 *     check leak ASSET               opens an asset and forgets it: what valgrind must find
 *
 * EXPECTED holds what Rust says of the asset: a count, then as many `record`s. DAMAGED is a folder of files that are
 * no assets any more. */

#include "btf.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define THREADS 4
#define ROUNDS 3
#define DRAWS 8000
#define SIDE 90

typedef struct record {
    uint32_t level;
    uint32_t interpolation;
    btf_place place;
    float value[3];
    float density;
} record;

static int failures = 0;

static void check(int holds, const char *what) {
    if (!holds) {
        failures++;
        printf("failed: %s\n", what);
    }
}

static void *read_file(const char *path, size_t *length) {
    FILE *file = fopen(path, "rb");
    void *bytes = NULL;
    long size = -1;
    if (file != NULL && fseek(file, 0, SEEK_END) == 0 && (size = ftell(file)) > 0 && fseek(file, 0, SEEK_SET) == 0) {
        bytes = malloc((size_t)size);
    }
    if (bytes == NULL || fread(bytes, 1, (size_t)size, file) != (size_t)size) {
        printf("failed: %s cannot be read\n", path);
        exit(1);
    }
    fclose(file);
    *length = (size_t)size;
    return bytes;
}

/* Bits are compared, so that -0 is not 0 and NaN is itself. */
static int same(const float *a, const float *b, size_t count) {
    return memcmp(a, b, count * sizeof(float)) == 0;
}

/* How many records the library answers otherwise than Rust. */
static size_t differences(const btf_asset *asset, const record *records, size_t count) {
    size_t found = 0, i;
    for (i = 0; i < count; i++) {
        const record *r = &records[i];
        btf_options options = btf_default_options();
        float value[3] = {-1.0f, -1.0f, -1.0f}, density = -1.0f;
        options.interpolation = r->interpolation;
        if (btf_evaluate(asset, r->level, &r->place, &options, value) != BTF_OK ||
            btf_density(asset, r->level, &r->place, &options, &density) != BTF_OK || !same(value, r->value, 3) ||
            !same(&density, &r->density, 1)) {
            found++;
        }
    }
    return found;
}

static void check_values(const btf_asset *asset, const record *records, size_t count) {
    size_t found = differences(asset, records, count), lit = 0, i;
    if (found > 0) {
        printf("failed: %lu of %lu values differ from Rust's\n", (unsigned long)found, (unsigned long)count);
        failures++;
    }
    for (i = 0; i < count; i++) {
        lit += records[i].value[1] > 0.0f;
    }
    check(lit > count / 4, "a quarter of the values is not black");
}

/* Many at once are what they are one by one, also where the options are left out. */
static void check_many(const btf_asset *asset, const record *records, size_t count) {
    btf_place *places = (btf_place *)malloc(count * sizeof *places);
    float *values = (float *)malloc(3 * count * sizeof *values);
    size_t wrong = 0, i;
    if (places == NULL || values == NULL) {
        exit(1);
    }
    for (i = 0; i < count; i++) {
        places[i] = records[i].place;
    }
    check(btf_evaluate_many(asset, 1, places, count, NULL, values) == BTF_OK, "many places are evaluated");
    for (i = 0; i < count; i++) {
        float value[3];
        check(btf_evaluate(asset, 1, &places[i], NULL, value) == BTF_OK, "one place is evaluated");
        wrong += !same(value, values + 3 * i, 3);
    }
    check(wrong == 0, "many values are those of one place each");
    /* Planted difference: every value taken for its neighbour's. */
    for (i = wrong = 0; i + 1 < count; i++) {
        wrong += !same(values + 3 * i, values + 3 * i + 3, 3);
    }
    check(wrong > count / 4, "values are told apart");
    check(btf_evaluate_many(asset, 0, NULL, 0, NULL, NULL) == BTF_OK, "no places at all are no error");
    free(places);
    free(values);
}

static void check_fault(btf_code code, btf_code expected, const char *words) {
    const char *sentence = btf_last_error();
    if (code != expected || strstr(sentence, words) == NULL) {
        printf("failed: code %d (%s) with \"%s\", expected %d with \"%s\"\n", (int)code, btf_error_text(code),
               sentence, (int)expected, words);
        failures++;
    }
}

static void check_open_faults(const char *asset_path, const char *damaged) {
    static const struct {
        const char *name;
        btf_code code;
        const char *words;
    } files[] = {
        {"missing.spmm", BTF_FILE, "missing.spmm cannot be read"},
        {"truncated.spmm", BTF_LENGTH, "cut off"},
        {"short.spmm", BTF_LENGTH, "too short"},
        {"empty.spmm", BTF_LENGTH, "too short"},
        {"appended.spmm", BTF_LENGTH, "appended"},
        {"magic.spmm", BTF_NOT_AN_ASSET, "magic.spmm: this is not an SPMM asset"},
        {"version.spmm", BTF_VERSION, "version"},
        {"flipped.spmm", BTF_DAMAGED, "damaged"},
    };
    btf_open_options options = btf_default_open_options();
    btf_asset *asset;
    size_t i, length;
    void *bytes = read_file(asset_path, &length);
    for (i = 0; i < sizeof files / sizeof files[0]; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/%s", damaged, files[i].name);
        asset = (btf_asset *)(void *)&options;
        check_fault(btf_open_file(path, NULL, &asset), files[i].code, files[i].words);
        check(asset == NULL, "a file that is refused leaves no handle");
    }
    asset = (btf_asset *)(void *)&options;
    check_fault(btf_open_memory((const uint8_t *)bytes, length - 1, NULL, &asset), BTF_LENGTH, "cut off");
    check(asset == NULL, "bytes that are refused leave no handle");
    check_fault(btf_open_memory(NULL, length, NULL, &asset), BTF_POINTER, "'bytes' is null");
    check_fault(btf_open_memory((const uint8_t *)bytes, SIZE_MAX, NULL, &asset), BTF_ARGUMENT, "'bytes'");
    check_fault(btf_open_memory((const uint8_t *)bytes, length, NULL, NULL), BTF_POINTER, "'asset' is null");
    check_fault(btf_open_file(NULL, NULL, &asset), BTF_POINTER, "'path' is null");
    check_fault(btf_open_file(asset_path, NULL, NULL), BTF_POINTER, "'asset' is null");
    options.levels = 2;
    check_fault(btf_open_file(asset_path, &options, &asset), BTF_ARGUMENT, "levels is 2");
    free(bytes);
}

static void check_read_faults(const btf_asset *asset) {
    const btf_place place = {{0.5f, 0.5f}, {0.0f, 0.0f, 1.0f}, {0.0f, 0.0f, 1.0f}};
    const float *uv = place.uv, *wo = place.wo;
    const float at[3] = {0.5f, 0.5f, 0.5f};
    btf_options options = btf_default_options();
    btf_info info;
    btf_drawn drawn;
    const uint32_t *words;
    const char *text;
    size_t count;
    float value[4] = {7.0f, 7.0f, 7.0f, 7.0f}, density;
    float *odd = (float *)(void *)((char *)value + 1);

    check(btf_query(asset, &info) == BTF_OK, "the asset is queried");
    check_fault(btf_query(NULL, &info), BTF_POINTER, "'asset' is null");
    check_fault(btf_query(asset, NULL), BTF_POINTER, "'info' is null");
    check_fault(btf_material(asset, NULL, &count), BTF_POINTER, "'text' is null");
    check_fault(btf_material(NULL, &text, &count), BTF_POINTER, "'asset' is null");
    check_fault(btf_resident(asset, NULL, &count), BTF_POINTER, "'words' is null");
    check_fault(btf_resident(asset, &words, NULL), BTF_POINTER, "'count' is null");
    check_fault(btf_evaluate(NULL, 0, &place, NULL, value), BTF_POINTER, "'asset' is null");
    check_fault(btf_evaluate(asset, 0, NULL, NULL, value), BTF_POINTER, "'place' is null");
    check_fault(btf_evaluate(asset, 0, &place, NULL, NULL), BTF_POINTER, "'value' is null");
    check_fault(btf_evaluate(asset, 0, &place, NULL, odd), BTF_POINTER, "'value' is not aligned");
    check_fault(btf_evaluate(asset, info.levels, &place, NULL, value), BTF_ARGUMENT, "was asked for");
    check_fault(btf_evaluate(asset, UINT32_MAX, &place, NULL, value), BTF_ARGUMENT, "was asked for");
    check_fault(btf_evaluate_many(asset, 99, &place, 1, NULL, value), BTF_ARGUMENT, "level 99 was asked for");
    check_fault(btf_evaluate_many(asset, 0, NULL, 1, NULL, value), BTF_POINTER, "'places' is null");
    check_fault(btf_evaluate_many(asset, 0, &place, 1, NULL, NULL), BTF_POINTER, "'values' is null");
    check_fault(btf_evaluate_many(asset, 0, &place, SIZE_MAX / 8, NULL, value), BTF_ARGUMENT, "'places' cannot have");
    check_fault(btf_sample(asset, 0, NULL, wo, at, NULL, &drawn), BTF_POINTER, "'uv' is null");
    check_fault(btf_sample(asset, 0, uv, NULL, at, NULL, &drawn), BTF_POINTER, "'wo' is null");
    check_fault(btf_sample(asset, 0, uv, wo, NULL, NULL, &drawn), BTF_POINTER, "'at' is null");
    check_fault(btf_sample(asset, 0, uv, wo, at, NULL, NULL), BTF_POINTER, "'drawn' is null");
    check_fault(btf_sample(asset, 99, uv, wo, at, NULL, &drawn), BTF_ARGUMENT, "level 99 was asked for");
    check_fault(btf_density(asset, 0, &place, NULL, NULL), BTF_POINTER, "'density' is null");
    check_fault(btf_density(asset, 99, &place, NULL, &density), BTF_ARGUMENT, "level 99 was asked for");
    options.interpolation = 2;
    check_fault(btf_evaluate(asset, 0, &place, &options, value), BTF_ARGUMENT, "interpolation is 2");
    options = btf_default_options();
    options.heights = 3;
    check_fault(btf_evaluate(asset, 0, &place, &options, value), BTF_ARGUMENT, "heights is 3");
    check(value[0] == 7.0f && value[3] == 7.0f, "a call that fails leaves the values");
    check(strcmp(btf_error_text(BTF_OK), "no error") == 0, "the text of no error");
    check(strlen(btf_error_text(-5)) > 0 && strlen(btf_error_text(12345)) > 0, "any code has a text");
    btf_close(NULL);
}

static void check_information(const btf_asset *asset) {
    btf_info info;
    const uint32_t *words = NULL;
    const char *text = NULL, *again = NULL;
    size_t count = 0, length = 0;
    check(btf_query(asset, &info) == BTF_OK && info.width == 6 && info.height == 5 && info.layers == 2, "the size");
    check(info.levels == 3 && info.components == 4 && info.lobes == 4, "levels, components and lobes");
    check(info.width_mm == 30.0f && info.height_mm == 25.0f && info.seamless == 1, "the physical size and seams");
    check(info.sides == (BTF_FRONT_LIT_FRONT | BTF_FRONT_LIT_BACK), "the sides");
    check(btf_material(asset, &text, &length) == BTF_OK && text[length] == 0 && strlen(text) == length, "the text");
    check(btf_material(asset, &again, NULL) == BTF_OK && again == text, "the text without its length");
    check(strstr(text, "sample 31") != NULL, "the material's name");
    check(btf_resident(asset, &words, &count) == BTF_OK && count > 100, "the resident words");
    check(words[0] == info.width && words[1] == info.height && words[3] == count, "the first words");
}

static float next_random(uint32_t *state) {
    *state = *state * 1664525u + 1013904223u;
    return (float)(*state >> 8) / 16777216.0f;
}

/* Drawn texels have bilinear weights as their shares, and the middle draw is the nearest texel. */
static void check_between(const btf_asset *asset) {
    btf_info info;
    float uv[2], between[2], at[2] = {0.5f, 0.5f};
    int i, right = 0;
    check(btf_query(asset, &info) == BTF_OK, "an asset tells its size");
    /* A quarter of a texel right of the middle of the third one, in the middle of the second row. */
    uv[0] = 2.75f / (float)info.width;
    uv[1] = 1.0f - 1.5f / (float)info.height;
    check(btf_uv_between(asset, 0, uv, at, between) == BTF_OK, "a texel is drawn");
    check(fabsf(between[0] * (float)info.width - 2.5f) < 1e-3f, "the middle draw is the nearest texel");
    check(fabsf((1.0f - between[1]) * (float)info.height - 1.5f) < 1e-3f, "and its row");
    for (i = 0; i < 100; i++) {
        at[0] = ((float)i + 0.5f) / 100.0f;
        check(btf_uv_between(asset, 0, uv, at, between) == BTF_OK, "a texel is drawn");
        right += fabsf(between[0] * (float)info.width - 3.5f) < 1e-3f;
    }
    check(right == 25, "a quarter of the draws are the next texel");
    check_fault(btf_uv_between(asset, 0, uv, at, NULL), BTF_POINTER, "'between' is null");
    check_fault(btf_uv_between(asset, 99, uv, at, between), BTF_ARGUMENT, "level 99 was asked for");
}

/* Samples over their density sum up to what all directions evenly give, and btf_density agrees. */
static void check_sampling(const btf_asset *asset) {
    const float uv[2] = {0.3f, 0.7f}, wo[3] = {0.57357644f, 0.0f, 0.81915204f};
    const double pi = 3.14159265358979323846;
    double whole = 0.0, sum = 0.0, planted = 0.0;
    uint32_t state = 12;
    int i, j, disagree = 0, drawn_count = 0;
    for (i = 0; i < SIDE; i++) {
        for (j = 0; j < SIDE; j++) {
            const double z = 2.0 * (i + 0.5) / SIDE - 1.0, phi = 2.0 * pi * (j + 0.5) / SIDE, r = sqrt(1.0 - z * z);
            btf_place place = {{0.3f, 0.7f}, {0.0f, 0.0f, 0.0f}, {0.57357644f, 0.0f, 0.81915204f}};
            float value[3];
            place.wi[0] = (float)(r * cos(phi));
            place.wi[1] = (float)(r * sin(phi));
            place.wi[2] = (float)z;
            check(btf_evaluate(asset, 0, &place, NULL, value) == BTF_OK, "a direction is evaluated");
            whole += value[1];
        }
    }
    whole *= 4.0 / ((double)SIDE * SIDE);
    for (i = 0; i < DRAWS; i++) {
        float at[3];
        btf_drawn drawn;
        btf_place place = {{0.3f, 0.7f}, {0.0f, 0.0f, 0.0f}, {0.57357644f, 0.0f, 0.81915204f}};
        float density, value[3];
        at[0] = next_random(&state);
        at[1] = next_random(&state);
        at[2] = next_random(&state);
        check(btf_sample(asset, 0, uv, wo, at, NULL, &drawn) == BTF_OK, "a direction is drawn");
        if (drawn.density <= 0.0f) {
            continue;
        }
        drawn_count++;
        memcpy(place.wi, drawn.wi, sizeof place.wi);
        check(btf_density(asset, 0, &place, NULL, &density) == BTF_OK, "a density is told");
        check(btf_evaluate(asset, 0, &place, NULL, value) == BTF_OK, "a drawn direction is evaluated");
        disagree += !(fabsf(density - drawn.density) <= 1e-4f * density) || !same(value, drawn.value, 3);
        sum += drawn.value[1] / (pi * drawn.density);
        /* Planted difference: the density of one side alone. */
        planted += 0.5 * drawn.value[1] / (pi * drawn.density);
    }
    sum /= DRAWS * whole;
    planted /= DRAWS * whole;
    printf("%d drawn, their sum over that of all directions evenly: %.4f\n", drawn_count, sum);
    check(disagree == 0, "density and value of what is drawn are those that are told");
    check(drawn_count > DRAWS / 2 && fabs(sum - 1.0) < 0.04, "samples sum up to the whole");
    check(fabs(planted - 1.0) > 0.2, "a wrong density is found");
}

typedef struct job {
    const btf_asset *asset;
    const record *records;
    size_t count;
    size_t wrong;
    int number;
} job;

static void *work(void *argument) {
    job *job_ = (job *)argument;
    char words[64];
    int round;
    for (round = 0; round < ROUNDS; round++) {
        float value[3];
        /* Each thread has a last error of its own. */
        const uint32_t level = (uint32_t)(1000 + 10 * job_->number + round);
        job_->wrong += btf_evaluate(job_->asset, level, &job_->records->place, NULL, value) != BTF_ARGUMENT;
        job_->wrong += differences(job_->asset, job_->records, job_->count);
        snprintf(words, sizeof words, "level %u was asked for", (unsigned)level);
        job_->wrong += strstr(btf_last_error(), words) == NULL;
    }
    return NULL;
}

static void check_threads(const btf_asset *asset, const record *records, size_t count) {
    pthread_t threads[THREADS];
    job jobs[THREADS];
    int i;
    for (i = 0; i < THREADS; i++) {
        job job_ = {NULL, NULL, 0, 0, 0};
        job_.asset = asset;
        job_.records = records;
        job_.count = count;
        job_.number = i;
        jobs[i] = job_;
        if (pthread_create(&threads[i], NULL, work, &jobs[i]) != 0) {
            printf("failed: thread %d does not start\n", i);
            exit(1);
        }
    }
    for (i = 0; i < THREADS; i++) {
        pthread_join(threads[i], NULL);
        check(jobs[i].wrong == 0, "threads read one handle at once");
    }
}

int main(int count, char **arguments) {
    btf_open_options options = btf_default_open_options();
    btf_asset *from_file = NULL, *from_memory = NULL;
    size_t length, records_count;
    void *bytes;
    unsigned char *expected;
    record *records;

    if (count == 3 && strcmp(arguments[1], "leak") == 0) {
        return btf_open_file(arguments[2], NULL, &from_file) == BTF_OK ? 0 : 1;
    }
    if (count != 4) {
        printf("usage: check ASSET EXPECTED DAMAGED\n");
        return 2;
    }
    check(strcmp(btf_last_error(), "") == 0, "at first there is no error");
    options.levels = BTF_LEVELS_ALL;
    if (btf_open_file(arguments[1], &options, &from_file) != BTF_OK) {
        printf("failed: %s\n", btf_last_error());
        return 1;
    }
    bytes = read_file(arguments[1], &length);
    options.threads = 1;
    if (btf_open_memory((const uint8_t *)bytes, length, &options, &from_memory) != BTF_OK) {
        printf("failed: %s\n", btf_last_error());
        return 1;
    }
    /* Not needed once the asset is open. */
    memset(bytes, 0xff, length);
    free(bytes);

    expected = (unsigned char *)read_file(arguments[2], &length);
    records_count = length / sizeof(record);
    check(length % sizeof(record) == 0 && records_count >= 100, "the expected values have the structs' layout");
    records = (record *)(void *)expected;
    check_values(from_file, records, records_count);
    check_values(from_memory, records, records_count);
    check_many(from_file, records, records_count);
    check_information(from_file);
    check_open_faults(arguments[1], arguments[3]);
    check_read_faults(from_file);
    check_between(from_memory);
    check_sampling(from_memory);
    check_threads(from_memory, records, records_count);

    free(expected);
    btf_close(from_file);
    btf_close(from_memory);
    printf(failures == 0 ? "all holds\n" : "%d failures\n", failures);
    return failures == 0 ? 0 : 1;
}
