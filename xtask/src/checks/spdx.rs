//! A small evaluator of SPDX licence expressions: may we use what carries this licence, given a list of accepted ones?
//!
//! Grammar (SPDX 2.3, annex D), strongest binding first: an identifier, optionally `+`, optionally `WITH` an exception;
//! `AND`; `OR`. Old crates write `MIT/Apache-2.0`; crates.io took the slash for `OR`, and so do we.

/// Returns whether `expression` can be satisfied with the licences that `accepts` allows.
///
/// `OR` leaves the choice to us, so one accepted side is enough; `AND` binds us to both. An exception (`WITH`) only adds
/// permissions, so the licence before it decides. Returns an error where the text is not such an expression.
pub fn is_satisfied(expression: &str, accepts: &dyn Fn(&str) -> bool) -> Result<bool, String> {
    let tokens = tokens_of(expression);
    let mut parser = Parser { tokens: &tokens, at: 0, accepts };
    let satisfied = parser.alternatives()?;
    match parser.peek() {
        None => Ok(satisfied),
        Some(token) => Err(format!("'{token}' is unexpected")),
    }
}

struct Parser<'a> {
    tokens: &'a [String],
    at: usize,
    accepts: &'a dyn Fn(&str) -> bool,
}

impl Parser<'_> {
    fn peek(&self) -> Option<&str> {
        self.tokens.get(self.at).map(String::as_str)
    }

    fn take(&mut self, token: &str) -> bool {
        let is_next = self.peek() == Some(token);
        self.at += usize::from(is_next);
        is_next
    }

    /// Both sides are always parsed, so that a mistake behind an accepted licence is still found.
    fn alternatives(&mut self) -> Result<bool, String> {
        let mut satisfied = self.conjunction()?;
        while self.take("OR") || self.take("/") {
            satisfied |= self.conjunction()?;
        }
        Ok(satisfied)
    }

    fn conjunction(&mut self) -> Result<bool, String> {
        let mut satisfied = self.licence()?;
        while self.take("AND") {
            satisfied &= self.licence()?;
        }
        Ok(satisfied)
    }

    fn licence(&mut self) -> Result<bool, String> {
        if self.take("(") {
            let satisfied = self.alternatives()?;
            return if self.take(")") { Ok(satisfied) } else { Err("a ')' is missing".to_string()) };
        }
        let identifier = self.identifier()?;
        // "or a later version" leaves us the version named.
        let satisfied = (self.accepts)(identifier.strip_suffix('+').unwrap_or(&identifier));
        if self.take("WITH") {
            self.identifier()?;
        }
        Ok(satisfied)
    }

    fn identifier(&mut self) -> Result<String, String> {
        let Some(token) = self.peek().map(str::to_string) else {
            return Err("it ends where a licence is expected".to_string());
        };
        let is_keyword = ["AND", "OR", "WITH", "(", ")", "/"].contains(&token.as_str());
        let is_identifier = token.chars().all(|c| c.is_ascii_alphanumeric() || "-.+:".contains(c));
        if is_keyword || !is_identifier {
            return Err(format!("'{token}' stands where a licence is expected"));
        }
        self.at += 1;
        Ok(token)
    }
}

/// Words, and each of `( ) /` by itself.
fn tokens_of(expression: &str) -> Vec<String> {
    let mut spaced = String::new();
    for c in expression.chars() {
        match c {
            '(' | ')' | '/' => spaced.extend([' ', c, ' ']),
            other => spaced.push(other),
        }
    }
    spaced.split_whitespace().map(str::to_string).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn satisfied(expression: &str) -> Result<bool, String> {
        is_satisfied(expression, &|licence| ["MIT", "Apache-2.0", "Zlib"].contains(&licence))
    }

    #[test]
    fn a_choice_with_one_accepted_side_is_accepted() {
        for expression in [
            "MIT",
            "MIT OR GPL-3.0",
            "GPL-3.0-only OR MIT",
            "GPL-2.0-only/MIT",
            "Apache-2.0 WITH LLVM-exception OR GPL-3.0-only",
            "(MIT OR GPL-3.0-only) AND Zlib",
            "GPL-3.0-only AND GPL-2.0-only OR Zlib",
            "Apache-2.0+",
        ] {
            assert_eq!(satisfied(expression), Ok(true), "{expression}");
        }
    }

    #[test]
    fn a_licence_that_is_not_on_the_list_is_rejected() {
        for expression in [
            "GPL-3.0-only",
            "MIT AND GPL-3.0-only",
            "GPL-3.0-only AND MIT",
            "(MIT OR Zlib) AND (GPL-3.0-only OR AGPL-3.0-only)",
            "GPL-2.0-only WITH Classpath-exception-2.0",
            // AND binds before OR: this is GPL or (LGPL and MIT).
            "GPL-3.0-only OR LGPL-3.0-only AND MIT",
            "MIT-0",
            "mit",
        ] {
            assert_eq!(satisfied(expression), Ok(false), "{expression}");
        }
    }

    #[test]
    fn text_that_is_no_expression_is_an_error_and_not_a_pass() {
        for expression in [
            "",
            "MIT OR",
            "OR MIT",
            "(MIT",
            "MIT)",
            "MIT Apache-2.0",
            "MIT, Apache-2.0",
            "MIT WITH",
            "MIT AND ()",
            "MIT//Zlib",
        ] {
            assert!(satisfied(expression).is_err(), "{expression}");
        }
    }
}
