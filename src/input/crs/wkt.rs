//! Well-known text of coordinate reference systems, versions 1 (OGC 01-009) and 2 (ISO 19162): units, names, codes.

use crate::input::crs::{Crs, Unit};

/// Nesting deeper than this is damage.
const DEEPEST: usize = 40;

/// `KEYWORD[value, value, ...]`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    pub(crate) keyword: String,
    values: Vec<Value>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Text(String),
    Number(f64),
    Node(Node),
}

impl Node {
    /// The systems that `text` holds: one, or as some writers have it a horizontal and a vertical one parted by a comma.
    fn parse_all(text: &str) -> Option<Vec<Node>> {
        const FILLING: [char; 5] = ['\0', ' ', '\n', '\r', '\t'];
        let mut rest = text.trim_matches(FILLING);
        let mut nodes = Vec::new();
        loop {
            nodes.push(Node::read(&mut rest, 0)?);
            rest = rest.trim_matches(FILLING);
            match rest.strip_prefix(',') {
                Some(more) => rest = more,
                None => return rest.is_empty().then_some(nodes),
            }
        }
    }

    fn read(rest: &mut &str, depth: usize) -> Option<Node> {
        let (keyword, inside) = rest.split_once(['[', '('])?;
        let keyword = keyword.trim();
        if depth > DEEPEST || keyword.is_empty() || !keyword.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_') {
            return None;
        }
        *rest = inside;
        let mut node = Node { keyword: keyword.to_ascii_uppercase(), values: Vec::new() };
        loop {
            node.values.push(Value::read(rest, depth)?);
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

    pub(crate) fn children(&self) -> impl Iterator<Item = &Node> {
        self.values.iter().filter_map(|value| if let Value::Node(node) = value { Some(node) } else { None })
    }

    pub(crate) fn child(&self, keywords: &[&str]) -> Option<&Node> {
        self.children().find(|child| keywords.contains(&child.keyword.as_str()))
    }

    pub(crate) fn text(&self, index: usize) -> Option<&str> {
        if let Some(Value::Text(text)) = self.values.get(index) { Some(text) } else { None }
    }

    /// Metres of its unit of length.
    pub(crate) fn unit_metres(&self) -> Option<f64> {
        units(self).0.and_then(length)
    }

    pub(crate) fn number(&self, index: usize) -> Option<f64> {
        match self.values.get(index)? {
            Value::Number(number) => Some(*number),
            Value::Text(text) => text.parse().ok(),
            Value::Node(_) => None,
        }
    }
}

impl Value {
    fn read(rest: &mut &str, depth: usize) -> Option<Value> {
        *rest = rest.trim_start();
        if let Some(quoted) = rest.strip_prefix('"') {
            return read_quoted(quoted, rest);
        }
        let end = rest.find([',', ']', ')', '[', '('])?;
        if rest[end..].starts_with(['[', '(']) {
            return Node::read(rest, depth + 1).map(Value::Node);
        }
        let word = rest[..end].trim();
        *rest = &rest[end..];
        Some(word.parse().map_or_else(|_| Value::Text(word.to_string()), Value::Number))
    }
}

/// The text up to the closing quote, where a doubled quote stands for one.
fn read_quoted<'a>(quoted: &'a str, rest: &mut &'a str) -> Option<Value> {
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
    Some(Value::Text(text))
}

pub(crate) const PROJECTED: [&str; 3] = ["PROJCS", "PROJCRS", "PROJECTEDCRS"];
const GEOGRAPHIC: [&str; 6] = ["GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS", "GEOCCS"];
const LOCAL: [&str; 3] = ["LOCAL_CS", "ENGCRS", "ENGINEERINGCRS"];
const VERTICAL: [&str; 4] = ["VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"];
const COMPOUND: [&str; 2] = ["COMPD_CS", "COMPOUNDCRS"];
const UNITS: [&str; 3] = ["UNIT", "LENGTHUNIT", "ANGLEUNIT"];

/// The part of the system in `text` whose keyword is one of these.
pub(crate) fn find(text: &str, keywords: &[&str]) -> Option<Node> {
    let roots = Node::parse_all(text)?;
    let mut parts = roots.iter().flat_map(parts).map(unbound);
    parts.find(|part| keywords.contains(&part.keyword.as_str())).cloned()
}

/// The name of the vertical system in `text`.
pub(crate) fn vertical_name(text: &str) -> Option<String> {
    find(text, &VERTICAL)?.text(0).map(str::to_string).filter(|name| !name.is_empty())
}

/// What `text` says; `None` where it is not well-known text of a coordinate reference system.
pub(crate) fn parse(text: &str) -> Option<Crs> {
    let roots = Node::parse_all(text)?;
    let parts: Vec<&Node> = roots.iter().flat_map(parts).map(unbound).collect();
    let find = |keywords: &[&str]| parts.iter().find(|part| keywords.contains(&part.keyword.as_str())).copied();
    let horizontal = find(&PROJECTED).or_else(|| find(&GEOGRAPHIC)).or_else(|| find(&LOCAL))?;
    let geographic = GEOGRAPHIC[..5].contains(&horizontal.keyword.as_str());
    let (unit, third) = units(horizontal);
    let vertical = find(&VERTICAL).and_then(|vertical| units(vertical).0).or(third).and_then(length);
    Some(Crs {
        wkt: Some(text.trim_end_matches(['\0', ' ', '\n', '\r', '\t']).to_string()),
        epsg: epsg(horizontal),
        horizontal: unit.map_or(Unit::Unknown, |unit| if geographic { angle(unit) } else { Unit::of(length(unit)) }),
        vertical,
        name: horizontal.text(0).map(str::to_string).filter(|name| !name.is_empty()),
    })
}

/// The parameters of the projection in `text`, names in one spelling, sorted; empty where there are none.
pub(crate) fn parameters(text: &str) -> Vec<(String, f64)> {
    let mut found = Vec::new();
    for root in Node::parse_all(text).unwrap_or_default() {
        collect_parameters(&root, &mut found);
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    found
}

fn collect_parameters(node: &Node, found: &mut Vec<(String, f64)>) {
    if node.keyword == "PARAMETER"
        && let (Some(name), Some(value)) = (node.text(0), node.number(1))
    {
        found.push((super::plain(name), value));
    }
    // The base of a bound system also carries parameters, those of the datum shift, which say nothing of the plane.
    for child in node.children().filter(|child| child.keyword != "ABRIDGEDTRANSFORMATION") {
        collect_parameters(child, found);
    }
}

/// The parts of a compound system, or the system itself.
fn parts(node: &Node) -> Vec<&Node> {
    if COMPOUND.contains(&node.keyword.as_str()) { node.children().collect() } else { vec![node] }
}

/// The system that a bound one is about.
fn unbound(node: &Node) -> &Node {
    if node.keyword != "BOUNDCRS" {
        return node;
    }
    node.child(&["SOURCECRS"]).and_then(|source| source.children().next()).unwrap_or(node)
}

/// The unit of the first axis, or of all, and that of a third axis if there is one.
fn units(node: &Node) -> (Option<&Node>, Option<&Node>) {
    let common = node.child(&UNITS);
    let axes: Vec<&Node> = node.children().filter(|child| child.keyword == "AXIS").collect();
    let of_axis = |index: usize| axes.get(index).and_then(|axis| axis.child(&UNITS));
    let third = if axes.len() == 3 { of_axis(2).or(common) } else { None };
    (of_axis(0).or(common), third)
}

/// Metres of a unit of length.
fn length(unit: &Node) -> Option<f64> {
    let factor = unit.number(1).filter(|factor| factor.is_finite() && *factor > 0.0)?;
    (unit.keyword != "ANGLEUNIT" && !is_angle_name(unit)).then_some(factor)
}

fn angle(unit: &Node) -> Unit {
    if unit.keyword == "LENGTHUNIT" { Unit::of(length(unit)) } else { Unit::Degree }
}

fn is_angle_name(unit: &Node) -> bool {
    let name = unit.text(0).unwrap_or_default().to_ascii_lowercase();
    name.starts_with("degree") || name.starts_with("radian") || name.starts_with("grad")
}

fn epsg(node: &Node) -> Option<u32> {
    let authority = node.child(&["AUTHORITY", "ID"])?;
    let code = authority.number(1)?;
    let valid = authority.text(0)?.eq_ignore_ascii_case("EPSG") && code > 0.0 && code < 1e6 && code.fract() == 0.0;
    valid.then_some(code as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMPOUND_2: &str = r#"COMPOUNDCRS["a + b",PROJCRS["a",BASEGEOGCRS["g",DATUM["d",ELLIPSOID["e",6378137,298.25,
        LENGTHUNIT["metre",1]]],PRIMEM["Greenwich",0,ANGLEUNIT["degree",0.0174532925199433]]],CONVERSION["c",
        METHOD["Transverse Mercator",ID["EPSG",9807]],PARAMETER["False easting",1,LENGTHUNIT["US survey foot",0.304800609601219]]],
        CS[Cartesian,2],AXIS["(E)",east,ORDER[1],LENGTHUNIT["US survey foot",0.304800609601219]],
        AXIS["(N)",north,ORDER[2],LENGTHUNIT["US survey foot",0.304800609601219]],ID["EPSG",2276]],
        VERTCRS["b",VDATUM["v"],CS[vertical,1],AXIS["h",up,LENGTHUNIT["metre",1]]]]"#;

    #[test]
    fn a_compound_system_of_version_2_has_both_units() {
        let crs = parse(COMPOUND_2).unwrap();
        assert_eq!((crs.horizontal, crs.vertical), (Unit::UsFoot, Some(1.0)));
        assert_eq!((crs.epsg, crs.name.as_deref()), (Some(2276), Some("a")));
        assert_eq!(parameters(COMPOUND_2), [("falseeasting".to_string(), 1.0)]);
    }

    #[test]
    fn the_unit_of_a_projected_system_is_not_that_of_its_base() {
        let text = r#"PROJCS["P",GEOGCS["G",UNIT["degree",0.0174]],UNIT["Foot",0.3048],AUTHORITY["EPSG","2994"]]"#;
        let crs = parse(text).unwrap();
        assert_eq!((crs.horizontal, crs.vertical, crs.epsg), (Unit::Foot, None, Some(2994)));
    }

    #[test]
    fn geographic_systems_are_in_degrees_and_bound_ones_are_looked_into() {
        assert_eq!(parse(r#"GEOGCS["WGS 84",UNIT["degree",0.0174532925199433]]"#).unwrap().horizontal, Unit::Degree);
        let bound = r#"BOUNDCRS[SOURCECRS[PROJCRS["P",LENGTHUNIT["metre",1]]],TARGETCRS[GEOGCRS["W"]]]"#;
        assert_eq!(parse(bound).unwrap().horizontal, Unit::Metre);
    }

    #[test]
    fn two_systems_side_by_side_are_a_compound_one() {
        let text = r#"PROJCS["P",GEOGCS["G",UNIT["Degree",0.0174]],UNIT["Foot_US",0.3048006096012192]],VERTCS["V",UNIT["Meter",1.0]]"#;
        let crs = parse(text).unwrap();
        assert_eq!((crs.horizontal, crs.vertical, crs.name.as_deref()), (Unit::UsFoot, Some(1.0), Some("P")));
    }

    #[test]
    fn damage_is_no_system() {
        let deep = "A[".repeat(100_000);
        for text in
            ["", "hello", "PROJCS[", r#"PROJCS["x""#, "PROJCS[]]", "VERT_CS[\"v\",UNIT[\"metre\",1]]", deep.as_str()]
        {
            assert_eq!(parse(text), None, "{}", &text[..text.len().min(20)]);
        }
    }
}
