// Prints the colour of an asset's middle, seen from above, under lights from left to right:
//
//     cargo xtask c --prefix PREFIX
//     cmake -S runtime/c/examples/cmake -B build -DCMAKE_PREFIX_PATH=PREFIX && cmake --build build
//     build/evaluate viewer/src/scene/builtin/weave.spmm

#include <btf.hpp>

#include <cmath>
#include <cstdio>
#include <vector>

int main(int count, char **arguments) {
    if (count != 2) {
        std::fprintf(stderr, "usage: evaluate ASSET.spmm\n");
        return 2;
    }
    try {
        const btf::Asset asset = btf::Asset::open(arguments[1]);
        const btf::Info info = asset.info();
        std::printf("%u x %u texels, %u layers\n", info.width, info.height, info.layers);

        std::vector<btf::Place> places;
        for (int degrees = -60; degrees <= 60; degrees += 30) {
            const float angle = static_cast<float>(degrees) * 3.14159265f / 180.0f;
            places.push_back({{0.5f, 0.5f}, {std::sin(angle), 0.0f, std::cos(angle)}, {0.0f, 0.0f, 1.0f}});
        }
        std::vector<btf::Rgb> values(places.size());
        asset.evaluate(places, values);
        for (const auto &[red, green, blue] : values) {
            std::printf("%8.5f %8.5f %8.5f\n", red, green, blue);
        }
    } catch (const btf::Error &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
