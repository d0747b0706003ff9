/* Prints what an asset is, and its colour in the middle for a light that goes from left to right:
 *
 *     cargo build --release --package btf-runtime-c
 *     cc -std=c99 -Iruntime/c/include runtime/c/examples/evaluate.c target/release/libbtf.a \
 *        -lpthread -ldl -lm -o evaluate
 *     ./evaluate viewer/src/scene/builtin/weave.spmm
 */

#include "btf.h"

#include <math.h>
#include <stdio.h>

#define LIGHTS 11

int main(int count, char **arguments) {
    const double degree = 3.14159265358979323846 / 180.0;
    btf_asset *asset;
    btf_info info;
    const char *material;
    btf_place places[LIGHTS];
    float values[LIGHTS][3];
    int i;

    if (count != 2) {
        fprintf(stderr, "usage: evaluate ASSET.spmm\n");
        return 2;
    }
    if (btf_open_file(arguments[1], NULL, &asset) != BTF_OK) {
        fprintf(stderr, "%s\n", btf_last_error());
        return 1;
    }
    if (btf_query(asset, &info) != BTF_OK || btf_material(asset, &material, NULL) != BTF_OK) {
        fprintf(stderr, "%s\n", btf_last_error());
        btf_close(asset);
        return 1;
    }
    printf("%u x %u texels, %u layers, %u levels, %u components, %u lobes\n%s\n\n", (unsigned)info.width,
           (unsigned)info.height, (unsigned)info.layers, (unsigned)info.levels, (unsigned)info.components,
           (unsigned)info.lobes, material);

    /* The eye looks straight down, the light stands from 75 degrees on the left to 75 degrees on the right. */
    for (i = 0; i < LIGHTS; i++) {
        const double angle = (15.0 * i - 75.0) * degree;
        btf_place place = {{0.5f, 0.5f}, {0.0f, 0.0f, 1.0f}, {0.0f, 0.0f, 1.0f}};
        place.wi[0] = (float)sin(angle);
        place.wi[2] = (float)cos(angle);
        places[i] = place;
    }
    if (btf_evaluate_many(asset, 0, places, LIGHTS, NULL, &values[0][0]) != BTF_OK) {
        fprintf(stderr, "%s\n", btf_last_error());
        btf_close(asset);
        return 1;
    }
    printf("light      red    green     blue   (pi x BRDF x cosine: white Lambertian is %.3f at 60 degrees)\n",
           cos(60.0 * degree));
    for (i = 0; i < LIGHTS; i++) {
        printf("%4d  %8.5f %8.5f %8.5f\n", 15 * i - 75, values[i][0], values[i][1], values[i][2]);
    }
    btf_close(asset);
    return 0;
}
