fn main() {
    let args: Vec<String> = std::env::args().collect();
    for path in &args[1..] {
        let bytes = std::fs::read(path).unwrap();
        let mut asset = btf_runtime::Asset::parse(&bytes).unwrap();
        let residual = asset.layers[0].residual.as_mut().unwrap();
        let count = residual.coefficients.len();
        residual.groups = vec![
            btf_runtime::PredictedGroup { components: 3, inputs: [3; 4], own: 0 },
            btf_runtime::PredictedGroup { components: count - 3, inputs: [64, 64, 8, 16].map(|n: usize| n.min(count) as u8), own: 3 },
        ];
        let new = btf_runtime::pack(&asset).unwrap();
        let start = std::time::Instant::now();
        let back = btf_runtime::Asset::parse(&new).unwrap();
        println!("{path}: {} -> {} same {} {:.3} s", bytes.len(), new.len(), back == asset, start.elapsed().as_secs_f64());
        std::fs::write(format!("{path}.new.spmm"), &new).unwrap();
    }
}
