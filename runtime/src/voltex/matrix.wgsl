// Symmetric matrices of 3 x 3. Twin: voltex/matrix.rs.

struct VoltexMatrix {
    // xx, yy, zz.
    diagonal: vec3<f32>,
    // xy, xz, yz.
    beside: vec3<f32>,
}

fn voltex_times(m: VoltexMatrix, v: vec3<f32>) -> vec3<f32> {
    return m.diagonal * v + m.beside.xxy * v.yxx + m.beside.yzz * v.zzy;
}

// Returns `u' M v`. For the extinction matrix and `u = v` that is the square of the optical depth along v.
fn voltex_form(m: VoltexMatrix, u: vec3<f32>, v: vec3<f32>) -> f32 {
    return dot(u, voltex_times(m, v));
}

// Returns the adjugate: the inverse times the determinant.
fn voltex_adjugate(m: VoltexMatrix) -> VoltexMatrix {
    let d = m.diagonal;
    let b = m.beside;
    return VoltexMatrix(d.yxx * d.zzy - b.zyx * b.zyx, b.yxx * b.zzy - b * d.zyx);
}

fn voltex_scale(m: VoltexMatrix, s: f32) -> VoltexMatrix {
    return VoltexMatrix(s * m.diagonal, s * m.beside);
}
