//! Takes the noise out of pictures of few samples: an edge-avoiding a-trous wavelet filter [Dammertz 2010] over what pixels show
//! besides their light, as strong as the picture is noisy [Schied 2017].

pub(crate) mod a_trous;
pub(crate) mod features;
