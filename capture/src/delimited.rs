//! Text tables whose fields are separated by commas, semicolons or tabs: CSV, as it comes from many programs.

/// Returns the lines of a table with their numbers from 1, without spaces around them, empty lines and comments (`#`). Tabs
/// stay, since an empty first field has nothing else.
pub fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let numbered = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim_matches([' ', '\r'])));
    numbered.filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'))
}

/// Returns the separator of a table by its heading: the commonest of comma, semicolon and tab.
pub fn separator_of(heading: &str) -> char {
    [',', ';', '\t'].into_iter().max_by_key(|&c| heading.matches(c).count()).unwrap_or(',')
}

/// Splits a line at `separator`. A field in double quotes holds separators, and quotes that are doubled.
///
/// # Errors
/// What is wrong with the line, as a clause.
pub fn fields(line: &str, separator: char) -> Result<Vec<String>, &'static str> {
    let mut fields = Vec::new();
    let mut rest = line;
    loop {
        rest = rest.trim_start_matches(' ');
        if let Some(quoted) = rest.strip_prefix('"') {
            let mut value = String::new();
            let mut characters = quoted.char_indices();
            let end = loop {
                match characters.next() {
                    Some((at, '"')) => match quoted[at + 1..].starts_with('"') {
                        true => {
                            value.push('"');
                            characters.next();
                        }
                        false => break at + 1,
                    },
                    Some((_, other)) => value.push(other),
                    None => return Err("a quote in it is not closed"),
                }
            };
            fields.push(value);
            rest = quoted[end..].trim_start_matches(' ');
            match rest.strip_prefix(separator) {
                Some(tail) => rest = tail,
                None if rest.is_empty() => return Ok(fields),
                None => return Err("something stands behind a closing quote"),
            }
        } else {
            match rest.split_once(separator) {
                Some((value, tail)) => {
                    fields.push(value.trim().to_string());
                    rest = tail;
                }
                None => {
                    fields.push(rest.trim().to_string());
                    return Ok(fields);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_split_at_its_separators_and_quotes_hold_together() {
        assert_eq!(fields("a.png, 30 ,-90,0,0", ',').unwrap(), ["a.png", "30", "-90", "0", "0"]);
        assert_eq!(fields("\"a, \"\"b\"\".png\" ;30;1", ';').unwrap(), ["a, \"b\".png", "30", "1"]);
        assert_eq!(fields("a\t\tb", '\t').unwrap(), ["a", "", "b"]);
        assert_eq!(fields("a,", ',').unwrap(), ["a", ""]);
        for bad in ["\"a", "\"a\"b,c"] {
            assert!(fields(bad, ',').is_err(), "{bad}");
        }
    }

    #[test]
    fn lines_keep_their_numbers_and_the_heading_tells_the_separator() {
        let text = "# by hand\n\n nm;R;T\r\n400;0,1;0,2\n";
        let numbered: Vec<(usize, &str)> = lines(text).collect();
        assert_eq!(numbered, [(3, "nm;R;T"), (4, "400;0,1;0,2")]);
        assert_eq!(lines("\ta\tb").next(), Some((1, "\ta\tb")));
        assert_eq!(fields("\ta\tb", '\t').unwrap(), ["", "a", "b"]);
        assert_eq!([separator_of(numbered[0].1), separator_of("a\tb"), separator_of("a")], [';', '\t', '\t']);
    }
}
