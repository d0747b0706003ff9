//! Evaluates, samples and takes densities at random places of an asset and writes the answers as JSON, for tests of the
//! interfaces in other languages.
//!
//! `cargo run --release -p btf-runtime --example answers -- ASSET.spmm OUT.json`

use btf_runtime::testing::Random;
use btf_runtime::{DecodeOptions, Interpolation, Levels, Query, density, evaluate, open, sample, serial};
use std::fmt::Write;
use std::sync::Arc;

/// Number of places.
const PLACES: usize = 500;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(file), Some(out)) = (arguments.next(), arguments.next()) else {
        return Err("usage: answers ASSET.spmm OUT.json".into());
    };
    let bytes = std::fs::read(&file).map_err(|error| format!("{file}: {error}"))?;
    let asset = open(Arc::new(bytes), Levels::All, &serial)?.resident;
    let mut random = Random::new(7);
    let mut text = format!("{{\"levels\": {}, \"width\": {}, \"answers\": [", asset.levels(), asset.width());
    for number in 0..PLACES {
        let level = random.below(asset.levels() as usize) as u32;
        let uv = [0; 2].map(|_| random.within(-1.0, 2.0));
        let query = Query { uv, wi: random.direction(), wo: random.direction() };
        let at = [0; 3].map(|_| random.within(0.0, 1.0));
        let exact = number % 2 == 1;
        let interpolation = if exact { Interpolation::Exact } else { Interpolation::Fast };
        let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
        let value = evaluate(&asset, level, &query, &options);
        let pdf = density(&asset, level, &query, &options);
        let drawn = sample(&asset, level, uv, query.wo, at, &options).map_or("null".into(), |drawn| {
            format!("{{\"wi\": {:?}, \"pdf\": {:?}, \"value\": {:?}}}", drawn.wi, drawn.density, drawn.value)
        });
        let between = asset.uv_between(level, uv, [at[0], at[1]]);
        let comma = if number == 0 { "" } else { "," };
        write!(
            text,
            "{comma}\n{{\"level\": {level}, \"uv\": {uv:?}, \"wi\": {:?}, \"wo\": {:?}, \"at\": {at:?}, \"exact\": {exact}, \
             \"value\": {value:?}, \"pdf\": {pdf:?}, \"drawn\": {drawn}, \"between\": {between:?}}}",
            query.wi, query.wo
        )?;
    }
    text += "]}\n";
    std::fs::write(&out, text).map_err(|error| format!("{out}: {error}").into())
}
