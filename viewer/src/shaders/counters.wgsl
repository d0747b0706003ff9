// Counters of operations, joined with the text of a tracer by operations/instrument.rs, which declares COUNTERS, adds to
// `counted` throughout, and calls `add_counted` where an entry point ends.

// Those of the thread.
var<private> counted: array<u32, COUNTERS>;
// Those of all threads: the lower and the upper half of each.
@group(2) @binding(0) var<storage, read_write> counters: array<atomic<u32>, 2u * COUNTERS>;

// Adds the counters of the thread to those of all.
fn add_counted() {
    for (var i = 0u; i < COUNTERS; i++) {
        let more = counted[i];
        if more > 0u {
            let before = atomicAdd(&counters[2u * i], more);
            if before + more < before {
                atomicAdd(&counters[2u * i + 1u], 1u);
            }
        }
    }
}
