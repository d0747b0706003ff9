//! Which forms of a scene's assets are kept where all together may take so many bytes.

/// A form in which an asset may be kept.
#[derive(Debug, Clone, Copy)]
pub(super) struct Form {
    /// Bytes in memory.
    pub bytes: u64,
    /// Squared error of all pixels that show the asset.
    pub error: f64,
}

/// Chooses a form for each asset, `forms` being those that it may take, so that all take at most `budget` bytes
/// together; `None` where the smallest ones take more.
///
/// Begins with the form of least error of each asset, then takes the step that costs least error for the bytes that it
/// saves, again and again: the slopes of all assets' curves of bytes and error are about equal in the end.
pub(super) fn choose(forms: &[Vec<Form>], budget: u64) -> Option<Vec<usize>> {
    // Among equals the smaller: what no pixel shows is kept at its smallest.
    let best = |forms: &Vec<Form>| {
        (0..forms.len()).min_by(|a, b| {
            let [a, b] = [forms[*a], forms[*b]];
            a.error.total_cmp(&b.error).then(a.bytes.cmp(&b.bytes))
        })
    };
    let mut chosen: Vec<usize> = forms.iter().map(best).collect::<Option<_>>()?;
    loop {
        let taken: u64 = forms.iter().zip(&chosen).map(|(forms, at)| forms[*at].bytes).sum();
        if taken <= budget {
            return Some(chosen);
        }
        let steps = forms.iter().enumerate().flat_map(|(asset, forms)| {
            let now = forms[chosen[asset]];
            forms.iter().enumerate().filter(move |(_, form)| form.bytes < now.bytes).map(move |(at, form)| {
                let price = (form.error - now.error).max(0.0) / (now.bytes - form.bytes) as f64;
                (price, asset, at)
            })
        });
        let (_, asset, at) = steps.min_by(|a, b| a.0.total_cmp(&b.0))?;
        chosen[asset] = at;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn forms(of: &[(u64, f64)]) -> Vec<Form> {
        of.iter().map(|(bytes, error)| Form { bytes: *bytes, error: *error }).collect()
    }

    #[test]
    fn bytes_are_taken_where_they_buy_least() {
        // The second asset fills few pixels: its errors are a tenth.
        let large = forms(&[(100, 0.0), (50, 1.0), (20, 4.0)]);
        let small = forms(&[(100, 0.0), (50, 0.1), (20, 0.4)]);
        let both = [large, small];
        assert_eq!(choose(&both, 200), Some(vec![0, 0]));
        assert_eq!(choose(&both, 150), Some(vec![0, 1]));
        assert_eq!(choose(&both, 120), Some(vec![0, 2]));
        assert_eq!(choose(&both, 70), Some(vec![1, 2]));
        assert_eq!(choose(&both, 40), Some(vec![2, 2]));
        assert_eq!(choose(&both, 39), None);
    }

    #[test]
    fn what_no_pixel_shows_is_kept_at_its_smallest() {
        assert_eq!(choose(&[forms(&[(100, 0.0), (20, 0.0)])], 1000), Some(vec![1]));
        assert_eq!(choose(&[], 0), Some(Vec::new()));
    }
}
