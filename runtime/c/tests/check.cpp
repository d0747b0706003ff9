// What btf.hpp gives is what btf.h gives, assets close themselves, and what fails throws. Usage: check ASSET.spmm DAMAGED.spmm

#include <btf.hpp>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <type_traits>
#include <utility>
#include <vector>

static_assert(!std::is_copy_constructible<btf::Asset>::value && std::is_nothrow_move_constructible<btf::Asset>::value,
              "a handle has one owner");

#define HOLDS(condition)                                                           \
    do {                                                                           \
        if (!(condition)) {                                                        \
            std::printf("line %d: %s does not hold\n", __LINE__, #condition);      \
            std::exit(1);                                                          \
        }                                                                          \
    } while (0)

template <class Call> btf::Error error_of(Call call) {
    try {
        call();
    } catch (const btf::Error &error) {
        return error;
    }
    std::printf("nothing was thrown\n");
    std::exit(1);
}

int main(int count, char **arguments) {
    HOLDS(count == 3);
    btf::Asset asset = btf::Asset::open(arguments[1], {BTF_LEVELS_ALL, 1});
    HOLDS(asset.info().width == 6 && asset.info().layers == 2 && asset.info().levels > 1);
    HOLDS(asset.material().front() == '{' && asset.material().back() == '}');
    HOLDS(asset.resident().size() > 100 && asset.resident()[0] == 6);

    std::vector<btf::Place> places;
    for (int number = 0; number < 50; number++) {
        const float x = 0.02f * static_cast<float>(number) - 0.5f;
        places.push_back({{x, 0.3f}, {x, 0.6f, std::sqrt(0.64f - x * x)}, {0.0f, 0.28f, 0.96f}});
    }
    const btf::Options exact{7, 3, BTF_INTERPOLATION_EXACT, BTF_HEIGHTS_NONE};
    const btf_options plain = {7, 3, BTF_INTERPOLATION_EXACT, BTF_HEIGHTS_NONE};
    for (const bool all : {true, false}) {
        std::vector<btf::Rgb> values(places.size());
        asset.evaluate(places, values, 1, all ? btf::Options{} : exact);
        for (std::size_t i = 0; i < places.size(); i++) {
            float value[3], density;
            HOLDS(btf_evaluate(asset.get(), 1, &places[i], all ? nullptr : &plain, value) == BTF_OK);
            HOLDS(btf_density(asset.get(), 1, &places[i], all ? nullptr : &plain, &density) == BTF_OK);
            HOLDS(std::memcmp(value, values[i].data(), sizeof value) == 0);
            const btf::Rgb one = asset.evaluate(places[i], 1, all ? btf::Options{} : exact);
            HOLDS(std::memcmp(value, one.data(), sizeof value) == 0);
            HOLDS(asset.density(places[i], 1, all ? btf::Options{} : exact) == density);
        }
    }
    // Planted difference: the finest level has other values.
    HOLDS(asset.evaluate(places[3]) != asset.evaluate(places[3], 1));
    const btf::Drawn drawn = asset.sample({0.2f, 0.7f}, {0.6f, 0.0f, 0.8f}, {0.3f, 0.5f, 0.1f});
    btf_drawn plain_drawn;
    const float uv[] = {0.2f, 0.7f}, wo[] = {0.6f, 0.0f, 0.8f}, at[] = {0.3f, 0.5f, 0.1f};
    HOLDS(btf_sample(asset.get(), 0, uv, wo, at, nullptr, &plain_drawn) == BTF_OK && drawn.density > 0.0f);
    HOLDS(std::memcmp(&drawn, &plain_drawn, sizeof drawn) == 0);
    HOLDS(asset.uv_between({0.5f, 0.5f}, {0.1f, 0.9f}) != asset.uv_between({0.5f, 0.5f}, {0.9f, 0.1f}));

    HOLDS(error_of([&] { asset.evaluate(places[0], 99); }).code() == BTF_ARGUMENT);
    std::vector<btf::Rgb> few(3);
    HOLDS(error_of([&] { asset.evaluate(places, few); }).code() == BTF_ARGUMENT);
    const btf::Error damaged = error_of([&] { btf::Asset::open(arguments[2]); });
    HOLDS(damaged.code() == BTF_DAMAGED && std::strstr(damaged.what(), arguments[2]) != nullptr);
    HOLDS(error_of([&] { btf::Asset::open("no-such.spmm"); }).code() == BTF_FILE);
    const std::vector<std::uint8_t> noise(100, 7);
    HOLDS(error_of([&] { btf::Asset::from_memory(noise); }).code() == BTF_NOT_AN_ASSET);

    btf::Asset moved = std::move(asset);
    HOLDS(asset.get() == nullptr && moved.info().height == 5);
    HOLDS(error_of([&] { asset.info(); }).code() == BTF_POINTER);
    asset = btf::Asset::open(arguments[1]);
    asset.evaluate(btf::Span<const btf::Place>(), btf::Span<btf::Rgb>());
    std::printf("all holds\n");
}
