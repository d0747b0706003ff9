// Transmission of diffuse light through an absorbing layer, as printed and by a rational form. Twin: leaf/theta.rs.

const LEAF_MAX_ABSORPTION: f32 = 80.0;
const LEAF_THETA_P: f32 = 7.24335;
const LEAF_THETA_Q1: f32 = 8.220058;
const LEAF_THETA_Q2: f32 = 9.686885;
const LEAF_THETA_Q3: f32 = 2.157772;

fn leaf_three_piece_theta(k: f32) -> f32 {
    if k <= 1.0 {
        return 0.951 * exp(-1.463 * k);
    }
    if k <= 3.0 {
        return 0.743 * exp(-1.25 * k);
    }
    return 0.01;
}

fn leaf_rational_theta(absorption: f32) -> f32 {
    let k = min(absorption, LEAF_MAX_ABSORPTION);
    let p = 1.0 + k * (LEAF_THETA_P + k * 2.0 * LEAF_THETA_Q3);
    return exp(-k) * p / (1.0 + k * (LEAF_THETA_Q1 + k * (LEAF_THETA_Q2 + k * LEAF_THETA_Q3)));
}
