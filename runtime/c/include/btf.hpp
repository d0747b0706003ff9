/**
 * libbtf for C++17 and newer: the calls of btf.h on objects that close themselves, with spans and exceptions.
 *
 *     #include <btf.hpp>
 *
 *     const btf::Asset asset = btf::Asset::open("leaf.spmm");
 *     const btf::Place place{{0.25f, 0.75f}, {0.0f, 0.0f, 1.0f}, {0.6f, 0.0f, 0.8f}};
 *     const auto [r, g, b] = asset.evaluate(place);
 *
 * Meanings, units and ranges are those of btf.h. What fails there throws btf::Error here, and nothing was done. An asset may be
 * read by any number of threads at once; moving and destroying it must be alone.
 */

#ifndef BTF_HPP
#define BTF_HPP

#include "btf.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#if __has_include(<version>)
#include <version>
#endif
#ifdef __cpp_lib_span
#include <span>
#endif

namespace btf {

#ifdef __cpp_lib_span
template <class T> using Span = std::span<T>;
#else
/** A view of elements that lie one after the other; std::span where the library has it. */
template <class T> class Span {
  public:
    constexpr Span() noexcept = default;
    constexpr Span(T *data, std::size_t size) noexcept : data_(data), size_(size) {}
    /** Views a container that has data() and size(). */
    template <class Container, class = decltype(static_cast<T *>(std::declval<Container &>().data()))>
    constexpr Span(Container &&container) noexcept : data_(container.data()), size_(container.size()) {}

    constexpr T *data() const noexcept { return data_; }
    constexpr std::size_t size() const noexcept { return size_; }
    constexpr bool empty() const noexcept { return size_ == 0; }
    constexpr T &operator[](std::size_t index) const noexcept { return data_[index]; }
    constexpr T *begin() const noexcept { return data_; }
    constexpr T *end() const noexcept { return data_ + size_; }

  private:
    T *data_ = nullptr;
    std::size_t size_ = 0;
};
#endif

using Place = btf_place;
using Info = btf_info;
using Drawn = btf_drawn;
/** Linear red, green and blue. */
using Rgb = std::array<float, 3>;

/** A call that failed: its code, and in what() the fault and the remedy. */
class Error : public std::runtime_error {
  public:
    Error(btf_code code, const char *sentence) : std::runtime_error(sentence), code_(code) {}
    btf_code code() const noexcept { return code_; }

  private:
    btf_code code_;
};

/** Options of opening an asset; those of btf_default_open_options(). */
struct OpenOptions {
    btf_levels levels = BTF_LEVELS_AT_HAND;
    std::uint32_t threads = 0;
};

/** Options of an evaluation; those of btf_default_options(). */
struct Options {
    std::uint32_t components = UINT32_MAX;
    std::uint32_t lobes = UINT32_MAX;
    btf_interpolation interpolation = BTF_INTERPOLATION_FAST;
    btf_heights heights = BTF_HEIGHTS_RELIEF;
};

/** An open asset. */
class Asset {
  public:
    /** Opens a file, as btf_open_file. */
    static Asset open(const std::string &path, const OpenOptions &options = {}) {
        const btf_open_options plain = {options.levels, options.threads};
        btf_asset *asset = nullptr;
        check(btf_open_file(path.c_str(), &plain, &asset));
        return Asset(asset);
    }

    /** Opens the bytes of a file, as btf_open_memory; they are not needed afterwards. */
    static Asset from_memory(Span<const std::uint8_t> bytes, const OpenOptions &options = {}) {
        const btf_open_options plain = {options.levels, options.threads};
        btf_asset *asset = nullptr;
        check(btf_open_memory(bytes.data(), bytes.size(), &plain, &asset));
        return Asset(asset);
    }

    /** Returns the properties, as btf_query. */
    Info info() const {
        Info info;
        check(btf_query(get(), &info));
        return info;
    }

    /** Returns the description, JSON; it stays as long as the asset. */
    std::string_view material() const {
        const char *text = nullptr;
        std::size_t length = 0;
        check(btf_material(get(), &text, &length));
        return {text, length};
    }

    /** Returns the words of one storage buffer for the WGSL decoder; they stay as long as the asset. */
    Span<const std::uint32_t> resident() const {
        const std::uint32_t *words = nullptr;
        std::size_t count = 0;
        check(btf_resident(get(), &words, &count));
        return {words, count};
    }

    /** Returns pi x BRDF x |cosine of wi| at a place, as btf_evaluate. */
    Rgb evaluate(const Place &place, std::uint32_t level = 0, const Options &options = {}) const {
        const btf_options plain = plain_of(options);
        Rgb value;
        check(btf_evaluate(get(), level, &place, &plain, value.data()));
        return value;
    }

    /** Evaluates many places on the calling thread; `values` has as many elements as `places`, or the code is BTF_ARGUMENT. */
    void evaluate(Span<const Place> places, Span<Rgb> values, std::uint32_t level = 0, const Options &options = {}) const {
        static_assert(sizeof(Rgb) == 3 * sizeof(float), "colours lie one after the other");
        if (places.size() != values.size()) {
            throw Error(BTF_ARGUMENT, "there are not as many values as places: give one for each");
        }
        const btf_options plain = plain_of(options);
        float *first = values.empty() ? nullptr : values[0].data();
        check(btf_evaluate_many(get(), level, places.data(), places.size(), &plain, first));
    }

    /** Draws a direction to light, as btf_sample; its density is 0 where nothing was drawn. */
    Drawn sample(const std::array<float, 2> &uv, const std::array<float, 3> &wo, const std::array<float, 3> &at,
                 std::uint32_t level = 0, const Options &options = {}) const {
        const btf_options plain = plain_of(options);
        Drawn drawn;
        check(btf_sample(get(), level, uv.data(), wo.data(), at.data(), &plain, &drawn));
        return drawn;
    }

    /** Returns the density with which sample() draws the light of a place, per steradian. */
    float density(const Place &place, std::uint32_t level = 0, const Options &options = {}) const {
        const btf_options plain = plain_of(options);
        float density = 0.0f;
        check(btf_density(get(), level, &place, &plain, &density));
        return density;
    }

    /** Draws one of the four texels around a texture coordinate, as btf_uv_between. */
    std::array<float, 2> uv_between(const std::array<float, 2> &uv, const std::array<float, 2> &at,
                                    std::uint32_t level = 0) const {
        std::array<float, 2> between;
        check(btf_uv_between(get(), level, uv.data(), at.data(), between.data()));
        return between;
    }

    /** Returns the handle for calls of btf.h; null once the asset was moved from. */
    btf_asset *get() const noexcept { return handle_.get(); }

  private:
    struct Close {
        void operator()(btf_asset *asset) const noexcept { btf_close(asset); }
    };

    explicit Asset(btf_asset *asset) : handle_(asset) {}

    static void check(btf_code code) {
        if (code != BTF_OK) {
            throw Error(code, btf_last_error());
        }
    }

    static btf_options plain_of(const Options &options) {
        return {options.components, options.lobes, options.interpolation, options.heights};
    }

    std::unique_ptr<btf_asset, Close> handle_;
};

}  // namespace btf

#endif  // BTF_HPP
