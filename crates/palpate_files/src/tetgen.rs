//! TetGen volumes: a file of nodes and a file of elements, both text.

use crate::error::MeshFileError;
use crate::scanner::shorten;
use crate::volume::{NodeNumbers, Shape, TetrahedralRegion, Volume, VolumeBuilder};

const NODES: &str = "TetGen .node";
const ELEMENTS: &str = "TetGen .ele";

/// The lines of a file that have words. `#` begins a comment.
struct Table<'a> {
    format: &'static str,
    lines: Box<dyn Iterator<Item = (usize, &'a str)> + 'a>,
    line: usize,
    words: std::str::SplitWhitespace<'a>,
}

impl<'a> Table<'a> {
    fn new(format: &'static str, bytes: &'a [u8]) -> Result<Self, MeshFileError> {
        let text = std::str::from_utf8(bytes).map_err(|_| {
            let problem = "it is not text in UTF-8".into();
            MeshFileError::VolumeNotValid { format, problem }
        })?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let contents = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
        let lines = Box::new((1..).zip(contents).filter(|(_, line)| !line.is_empty()));
        Ok(Self { format, lines, line: 0, words: "".split_whitespace() })
    }

    fn not_valid(&self, problem: &str) -> MeshFileError {
        let problem = format!("line {}: {problem}", self.line);
        MeshFileError::VolumeNotValid { format: self.format, problem }
    }

    /// Goes to the next line; words that are left are skipped.
    fn next_line(&mut self) -> Result<(), MeshFileError> {
        let Some((line, content)) = self.lines.next() else {
            return Err(self.not_valid("it ends before the last of the elements that it states"));
        };
        (self.line, self.words) = (line, content.split_whitespace());
        Ok(())
    }

    /// The next number of the line.
    fn number<T: std::str::FromStr>(&mut self, of: &str) -> Result<T, MeshFileError> {
        let word = self.words.next().unwrap_or_default();
        word.parse().map_err(|_| {
            let kind = if of == "coordinate" { "a number" } else { "a whole number from 0" };
            self.not_valid(&format!("a {of} is `{}`; it must be {kind}", shorten(word)))
        })
    }

    /// The next number of the line, or 0 at its end.
    fn number_or_0(&mut self, of: &str) -> Result<u64, MeshFileError> {
        if self.words.clone().next().is_none() { Ok(0) } else { self.number(of) }
    }
}

/// Reads a volume from the content of its two files.
pub(crate) fn read(nodes: &[u8], elements: &[u8]) -> Result<Volume, MeshFileError> {
    let mut builder = VolumeBuilder::new(ELEMENTS);
    let numbers = read_nodes(nodes, &mut builder)?;
    read_elements(elements, &numbers, &mut builder)?;
    builder.finish(|[number, _]| TetrahedralRegion { number, name: None })
}

fn read_nodes(bytes: &[u8], builder: &mut VolumeBuilder) -> Result<NodeNumbers, MeshFileError> {
    let mut table = Table::new(NODES, bytes)?;
    table.next_line()?;
    let count = VolumeBuilder::check_count("number of nodes", table.number("number of nodes")?)?;
    let dimension: u64 = table.number("dimension")?;
    if dimension != 3 {
        return Err(table.not_valid(&format!("the dimension is {dimension}; it must be 3")));
    }
    let mut numbers = Vec::new();
    for _ in 0..count {
        table.next_line()?;
        numbers.push(table.number("number of a node")?);
        let position =
            [table.number("coordinate")?, table.number("coordinate")?, table.number("coordinate")?];
        builder.push_node(position);
    }
    NodeNumbers::new(NODES, &numbers, builder.nodes())
}

fn read_elements(
    bytes: &[u8],
    numbers: &NodeNumbers,
    builder: &mut VolumeBuilder,
) -> Result<(), MeshFileError> {
    let mut table = Table::new(ELEMENTS, bytes)?;
    table.next_line()?;
    let count: u64 = table.number("number of elements")?;
    let node_count =
        if table.words.clone().next().is_none() { 4 } else { table.number("number of nodes")? };
    if ![4, 10].contains(&node_count) {
        let problem = format!("the number of nodes of an element is {node_count}; it must be 4 or 10");
        return Err(table.not_valid(&problem));
    }
    let has_region = table.number_or_0("number of attributes")? > 0;
    for _ in 0..count {
        table.next_line()?;
        let _: u64 = table.number("number of an element")?;
        let mut corners = [0; 4];
        for place in 0..node_count {
            let number: u64 = table.number("node")?;
            if let Some(corner) = corners.get_mut(place) {
                *corner = numbers.index(number).ok_or_else(|| builder.node_missing(number))?;
            }
        }
        let region = if has_region { region(&mut table)? } else { 0 };
        builder.push(Shape::Tetrahedron, &corners, node_count > 4, [region, 0])?;
    }
    Ok(())
}

/// The attribute of a region, which TetGen writes as a floating-point number.
fn region(table: &mut Table) -> Result<i64, MeshFileError> {
    let word = table.words.next().unwrap_or_default();
    match word.parse::<f64>() {
        Ok(value) if value.fract() == 0.0 && value.abs() < 9e15 => Ok(value as i64),
        _ => Err(table.not_valid(&format!(
            "the attribute of a region is `{}`; it must be a whole number",
            shorten(word)
        ))),
    }
}
