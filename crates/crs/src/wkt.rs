//! Well-known text of coordinate reference systems, versions 1 (OGC 01-009) and 2 (ISO 19162): units, names, codes.

/// The deepest nesting that is read; deeper text is damaged.
const DEEPEST: usize = 40;

/// A node of the text: `KEYWORD[value, value, ...]`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WktNode {
    pub(crate) keyword: String,
    values: Vec<WktValue>,
}

/// A value of a node.
#[derive(Clone, Debug, PartialEq)]
enum WktValue {
    Text(String),
    Number(f64),
    WktNode(WktNode),
}

impl WktNode {
    /// Returns the systems in `text`: one, or, from some writers, a horizontal and a vertical one separated by a comma.
    pub(crate) fn parse_all(text: &str) -> Option<Vec<WktNode>> {
        const FILLING: [char; 5] = ['\0', ' ', '\n', '\r', '\t'];
        let mut rest = text.trim_matches(FILLING);
        let mut nodes = Vec::new();
        loop {
            nodes.push(WktNode::read(&mut rest, 0)?);
            rest = rest.trim_matches(FILLING);
            match rest.strip_prefix(',') {
                Some(more) => rest = more,
                None => return rest.is_empty().then_some(nodes),
            }
        }
    }

    fn read(rest: &mut &str, depth: usize) -> Option<WktNode> {
        let (keyword, inside) = rest.split_once(['[', '('])?;
        let keyword = keyword.trim();
        if depth > DEEPEST || keyword.is_empty() || !keyword.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_') {
            return None;
        }
        *rest = inside;
        let mut node = WktNode { keyword: keyword.to_ascii_uppercase(), values: Vec::new() };
        loop {
            node.values.push(WktValue::read(rest, depth)?);
            *rest = rest.trim_start();
            let next = rest.chars().next()?;
            *rest = &rest[next.len_utf8()..];
            match next {
                ',' => {}
                ']' | ')' => return Some(node),
                _ => return None,
            }
        }
    }

    pub(crate) fn children(&self) -> impl Iterator<Item = &WktNode> {
        self.values.iter().filter_map(|value| if let WktValue::WktNode(node) = value { Some(node) } else { None })
    }

    pub(crate) fn child(&self, keywords: &[&str]) -> Option<&WktNode> {
        self.children().find(|child| keywords.contains(&child.keyword.as_str()))
    }

    pub(crate) fn text(&self, index: usize) -> Option<&str> {
        if let Some(WktValue::Text(text)) = self.values.get(index) { Some(text) } else { None }
    }

    /// Returns the node of its unit: the unit of the first axis, or of all.
    pub(crate) fn unit(&self) -> Option<&WktNode> {
        units(self).0
    }

    /// Returns the metres of its unit of length.
    pub(crate) fn unit_metres(&self) -> Option<f64> {
        self.unit().and_then(length)
    }

    /// Returns its EPSG code.
    pub(crate) fn epsg(&self) -> Option<u32> {
        let authority = self.child(&["AUTHORITY", "ID"])?;
        let code = authority.number(1)?;
        let valid = authority.text(0)?.eq_ignore_ascii_case("EPSG") && code > 0.0 && code < 1e6 && code.fract() == 0.0;
        valid.then_some(code as u32)
    }

    /// Returns whether it is a system of x, y and z that count from the middle of the earth.
    pub(crate) fn is_geocentric(&self) -> bool {
        let axes = self.child(&["CS"]).and_then(|axes| axes.text(0));
        self.keyword == "GEOCCS"
            || (GEOGRAPHIC.contains(&self.keyword.as_str())
                && axes.is_some_and(|kind| kind.eq_ignore_ascii_case("cartesian")))
    }

    pub(crate) fn number(&self, index: usize) -> Option<f64> {
        match self.values.get(index)? {
            WktValue::Number(number) => Some(*number),
            WktValue::Text(text) => text.parse().ok(),
            WktValue::WktNode(_) => None,
        }
    }
}

impl WktValue {
    fn read(rest: &mut &str, depth: usize) -> Option<WktValue> {
        *rest = rest.trim_start();
        if let Some(quoted) = rest.strip_prefix('"') {
            return read_quoted(quoted, rest);
        }
        let end = rest.find([',', ']', ')', '[', '('])?;
        if rest[end..].starts_with(['[', '(']) {
            return WktNode::read(rest, depth + 1).map(WktValue::WktNode);
        }
        let word = rest[..end].trim();
        *rest = &rest[end..];
        Some(word.parse().map_or_else(|_| WktValue::Text(word.to_string()), WktValue::Number))
    }
}

/// Reads the text up to the closing quote; a doubled quote stands for one.
fn read_quoted<'a>(quoted: &'a str, rest: &mut &'a str) -> Option<WktValue> {
    let mut text = String::new();
    let mut left = quoted;
    loop {
        let (before, after) = left.split_once('"')?;
        text.push_str(before);
        left = after;
        match left.strip_prefix('"') {
            Some(after) => {
                text.push('"');
                left = after;
            }
            None => break,
        }
    }
    *rest = left;
    Some(WktValue::Text(text))
}

pub(crate) const PROJECTED: [&str; 3] = ["PROJCS", "PROJCRS", "PROJECTEDCRS"];
pub(crate) const GEOGRAPHIC: [&str; 6] = ["GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS", "GEOCCS"];
pub(crate) const LOCAL: [&str; 3] = ["LOCAL_CS", "ENGCRS", "ENGINEERINGCRS"];
pub(crate) const VERTICAL: [&str; 4] = ["VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"];
/// The geographic system of a projected one.
pub(crate) const BASE: [&str; 3] = ["GEOGCS", "BASEGEOGCRS", "BASEGEODCRS"];
pub(crate) const DATUM: [&str; 4] = ["DATUM", "TRF", "GEODETICDATUM", "ENSEMBLE"];
const COMPOUND: [&str; 2] = ["COMPD_CS", "COMPOUNDCRS"];
const UNITS: [&str; 3] = ["UNIT", "LENGTHUNIT", "ANGLEUNIT"];

/// Returns the first part of the system in `text` that has one of these keywords.
pub(crate) fn find(text: &str, keywords: &[&str]) -> Option<WktNode> {
    let roots = WktNode::parse_all(text)?;
    let mut parts = roots.iter().flat_map(parts);
    parts.find(|part| keywords.contains(&part.keyword.as_str())).cloned()
}

/// Returns whether `text` describes a system of a plane and one of heights together.
pub(crate) fn is_compound(text: &str) -> bool {
    COMPOUND.iter().any(|keyword| text.trim_start().starts_with(keyword))
}

/// Returns the parts of a compound system, or the system itself. Of bound systems these are the source systems, whether the whole is
/// bound or its parts are.
pub(crate) fn parts(node: &WktNode) -> Vec<&WktNode> {
    let node = unbound(node);
    if COMPOUND.contains(&node.keyword.as_str()) { node.children().map(unbound).collect() } else { vec![node] }
}

/// Returns the source system of a bound system, or the system itself.
fn unbound(node: &WktNode) -> &WktNode {
    if node.keyword != "BOUNDCRS" {
        return node;
    }
    node.child(&["SOURCECRS"]).and_then(|source| source.children().next()).unwrap_or(node)
}

/// Returns the seven parameters of the way to WGS 84 of the first bound system in `text`, if it gives them.
pub(crate) fn bound_shift(text: &str) -> Option<[f64; 7]> {
    let roots = WktNode::parse_all(text)?;
    let is_bound = |node: &&WktNode| node.keyword == "BOUNDCRS";
    let bound = roots.iter().flat_map(|root| std::iter::once(root).chain(root.children())).find(is_bound)?;
    let transformation = bound.child(&["ABRIDGEDTRANSFORMATION"])?;
    let method = transformation.child(&["METHOD"]).and_then(|method| method.text(0)).map(comparable_name);
    // The one method turns the points, the other one the axes.
    let sign = if method.is_some_and(|method| method.contains("coordinateframe")) { -1.0 } else { 1.0 };
    let parameters = transformation.children().filter(|child| child.keyword == "PARAMETER");
    let all: Vec<f64> = parameters.map(|parameter| parameter.number(1)).collect::<Option<_>>()?;
    match all.as_slice() {
        [x, y, z] => Some([*x, *y, *z, 0.0, 0.0, 0.0, 0.0]),
        // Its scale is a factor.
        [x, y, z, a, b, c, scale] => Some([*x, *y, *z, sign * a, sign * b, sign * c, (scale - 1.0) * 1e6]),
        _ => None,
    }
}

/// Returns the unit of the first axis, or of all axes, and the unit of the third axis if there is one.
pub(crate) fn units(node: &WktNode) -> (Option<&WktNode>, Option<&WktNode>) {
    let common = node.child(&UNITS);
    let axes: Vec<&WktNode> = node.children().filter(|child| child.keyword == "AXIS").collect();
    let of_axis = |index: usize| axes.get(index).and_then(|axis| axis.child(&UNITS));
    let third = if axes.len() == 3 { of_axis(2).or(common) } else { None };
    (of_axis(0).or(common), third)
}

/// Returns the metres of a unit of length; `None` for an angle.
pub(crate) fn length(unit: &WktNode) -> Option<f64> {
    let factor = unit.number(1).filter(|factor| factor.is_finite() && *factor > 0.0)?;
    (unit.keyword != "ANGLEUNIT" && !is_angle_name(unit)).then_some(factor)
}

/// Returns the degrees of a unit of angle; 1 without a unit.
pub(crate) fn degrees(unit: Option<&WktNode>) -> f64 {
    let name = unit.and_then(|unit| unit.text(0)).unwrap_or("degree").to_ascii_lowercase();
    if name.starts_with("degree") {
        // Writers round its radians.
        return 1.0;
    }
    if name.starts_with("grad") || name.starts_with("gon") {
        return 0.9;
    }
    unit.and_then(|unit| unit.number(1))
        .filter(|factor| factor.is_finite() && *factor > 0.0)
        .map_or(1.0, f64::to_degrees)
}

fn is_angle_name(unit: &WktNode) -> bool {
    let name = unit.text(0).unwrap_or_default().to_ascii_lowercase();
    name.starts_with("degree") || name.starts_with("radian") || name.starts_with("grad") || name.starts_with("gon")
}

/// Returns the letters and digits of a name in lower case: writers disagree on the rest.
pub(crate) fn comparable_name(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}
