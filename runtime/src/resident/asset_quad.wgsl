// Reads four words of assets at once. An includer whose buffer is an array of vec4<u32> leaves this file out and defines the
// function itself, for which a GPU takes one read in place of four.

// Returns the four words from word 4 * `index` on.
fn asset_quad(index: u32) -> vec4<u32> {
    let at = 4u * index;
    return vec4<u32>(asset_word(at), asset_word(at + 1u), asset_word(at + 2u), asset_word(at + 3u));
}
