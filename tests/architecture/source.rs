//! Reads the paths in a Rust source file from its tokens, without a parser.

/// A path such as `crate::input::Point`, in a `use` or anywhere else in the code.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct NamedPath {
    pub(crate) segments: Vec<String>,
    pub(crate) line: usize,
    /// The name that a `use` gives the item.
    pub(crate) binds: Option<String>,
    /// Whether it is a `pub use`, of any visibility.
    pub(crate) reexport: bool,
}

struct Token<'a> {
    text: &'a str,
    line: usize,
}

/// Returns all paths of a file, except those in `#[cfg(test)]` items.
pub(crate) fn paths(source: &str) -> Vec<NamedPath> {
    let tokens = without_tests(tokens(source));
    let text = |at: usize| tokens.get(at).map_or("", |token| token.text);
    let (mut paths, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        if text(at) == "use" && text(at + 1) != "<" {
            let reexport = at > 0 && matches!(text(at - 1), "pub" | ")");
            at += 1;
            use_tree(&tokens, &mut at, &[], reexport, &mut paths);
        } else if is_name(text(at)) && text(at + 1) == "::" && (at == 0 || text(at - 1) != "::") {
            let (line, mut segments) = (tokens[at].line, vec![text(at).to_owned()]);
            while text(at + 1) == "::" && is_name(text(at + 2)) {
                segments.push(text(at + 2).to_owned());
                at += 2;
            }
            paths.push(NamedPath { segments, line, binds: None, reexport: false });
        }
        at += 1;
    }
    paths
}

/// Adds the paths of one tree of a `use`, and moves `at` to the token behind the tree.
fn use_tree(tokens: &[Token], at: &mut usize, prefix: &[String], reexport: bool, paths: &mut Vec<NamedPath>) {
    let (mut segments, mut name, line) = (prefix.to_vec(), None, tokens[*at].line);
    while let Some(token) = tokens.get(*at) {
        match token.text {
            "," | "}" | ";" => break,
            "{" => {
                while tokens.get(*at).is_some_and(|token| token.text != "}") {
                    *at += 1;
                    use_tree(tokens, at, &segments, reexport, paths);
                }
                *at += 1;
                return;
            }
            "as" => {
                *at += 1;
                name = tokens.get(*at).map(|token| token.text.to_owned());
            }
            "self" if segments.len() > prefix.len() || !prefix.is_empty() => {}
            "::" => {}
            text => segments.push(text.to_owned()),
        }
        *at += 1;
    }
    if segments != prefix || (!prefix.is_empty() && tokens[*at - 1].text == "self") {
        let binds = name.or_else(|| segments.last().cloned());
        paths.push(NamedPath { segments, line, binds, reexport });
    }
}

/// Removes each `#[cfg(test)]` and the item that follows it.
fn without_tests(tokens: Vec<Token>) -> Vec<Token> {
    const TEST: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let (mut kept, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        if tokens[at..].iter().map(|token| token.text).take(TEST.len()).eq(TEST) {
            at += item_length(&tokens[at..]);
        } else {
            kept.push(at);
            at += 1;
        }
    }
    let mut tokens: Vec<Option<Token>> = tokens.into_iter().map(Some).collect();
    kept.into_iter().filter_map(|at| tokens[at].take()).collect()
}

/// Returns the number of tokens of an item: up to its `;`, or to the `}` that ends its body.
fn item_length(tokens: &[Token]) -> usize {
    let (mut depth, mut is_use) = (0, false);
    for (at, token) in tokens.iter().enumerate() {
        match token.text {
            "use" if depth == 0 => is_use = true,
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            _ => {}
        }
        if depth == 0 && (token.text == ";" || (token.text == "}" && !is_use)) {
            return at + 1;
        }
    }
    tokens.len()
}

/// Cuts a file into tokens, without white space, comments, and string and character literals.
fn tokens(source: &str) -> Vec<Token<'_>> {
    let (mut tokens, mut rest, mut line) = (Vec::new(), source, 1);
    while !rest.is_empty() {
        let (length, is_code) = next_token(rest);
        let (text, behind) = rest.split_at(length);
        if is_code {
            tokens.push(Token { text, line });
        }
        line += text.matches('\n').count();
        rest = behind;
    }
    tokens
}

/// Returns the length of the token at the start of `rest`, and whether it is code. `rest` is not empty.
fn next_token(rest: &str) -> (usize, bool) {
    let until = |end: &str, from: usize| rest[from..].find(end).map_or(rest.len(), |found| from + found + end.len());
    let first = rest.chars().next().map_or(1, char::len_utf8);
    let name = rest.find(|c: char| !is_name_char(c)).unwrap_or(rest.len());
    let hashes = rest[name..].bytes().take_while(|byte| *byte == b'#').count();
    if rest.starts_with("//") {
        (until("\n", 0), false)
    } else if rest.starts_with("/*") {
        (until("*/", 2), false)
    } else if matches!(&rest[..name], "r" | "br" | "cr") && rest[name + hashes..].starts_with('"') {
        (until(&format!("\"{}", "#".repeat(hashes)), name + hashes + 1), false)
    } else if matches!(&rest[..name], "" | "b" | "c") && rest[name..].starts_with('"') {
        (name + quoted_length(&rest[name..], b'"'), false)
    } else if rest.starts_with('\'') && is_char_literal(rest) {
        (quoted_length(rest, b'\''), false)
    } else if name > 0 {
        (name, true)
    } else if rest.starts_with("::") {
        (2, true)
    } else {
        (first, !rest.starts_with(char::is_whitespace))
    }
}

/// Returns the length of the literal at the start of `rest`, which begins with `quote`.
fn quoted_length(rest: &str, quote: u8) -> usize {
    let bytes = rest.as_bytes();
    let mut at = 1;
    while at < bytes.len() && bytes[at] != quote {
        at += if bytes[at] == b'\\' { 2 } else { 1 };
    }
    (at + 1).min(rest.len())
}

/// Tells whether the apostrophe at the start of `rest` begins a character literal and not a lifetime.
fn is_char_literal(rest: &str) -> bool {
    let mut characters = rest.chars().skip(1);
    characters.next() == Some('\\') || characters.next() == Some('\'')
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

fn is_name_char(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}
