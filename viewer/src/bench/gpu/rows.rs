//! The rows that steps hand over.

use serde::Serialize;

/// Takes the rows of a step, each a JSON object with a `kind`, as they are measured.
pub(super) type Rows<'a> = &'a mut dyn FnMut(serde_json::Value);

/// Makes the row of a kind from figures.
pub(super) fn row_of(kind: &str, figures: &impl Serialize) -> serde_json::Value {
    let mut row = serde_json::to_value(figures).unwrap_or_default();
    row["kind"] = kind.into();
    row
}
