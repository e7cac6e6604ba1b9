//! The page: a table with inline figures, light and dark.

use super::row::Row;
use std::fmt::Write;

const HEAD: &str = r##"<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>The seed paper, reproduced</title>
<style>
:root { color-scheme: light dark; --ink: #1a1a1a; --page: #ffffff; --rule: #d8d8d8; --quiet: #5c5c5c; --band: #f4f6f8; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e6e6; --page: #16181b; --rule: #3a3d42; --quiet: #a0a4aa; --band: #1f2226; }
}
body { margin: 2rem auto; max-width: 68rem; padding: 0 1rem; background: var(--page); color: var(--ink);
  font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.6rem; margin-bottom: 0; }
p.lead, .why { color: var(--quiet); }
table { width: 100%; border-collapse: collapse; }
th, td { text-align: left; vertical-align: top; padding: 0.5rem 0.8rem; border-bottom: 1px solid var(--rule); }
thead th { border-bottom: 2px solid var(--ink); }
th.place { white-space: nowrap; font-weight: 600; }
tr.figure td { background: var(--band); }
tr.figure svg { display: block; margin: 0 auto; max-width: 100%; height: auto; color: var(--ink); }
.why { font-size: 0.9rem; }
</style>
</head>
<body>
"##;

/// HTML page with `rows`.
pub(super) fn html(rows: &[Row]) -> String {
    let mut page = String::from(HEAD);
    let figures = rows.iter().filter(|row| row.figure.is_some()).count();
    // Writing to a string cannot fail.
    let _ = write!(
        page,
        "<h1>The seed paper, reproduced</h1>\n<p class=\"lead\">M. C. Çavuşoğlu, <cite>Multirate Simulation for High \
         Fidelity Haptic Interaction with Deformable Objects in Virtual Environments</cite>, UCB/ERL M00/5, 2000. Every \
         figure and number of the paper with the result here. {} rows, {figures} with a figure; created by \
         palpate-paper {}.</p>\n<table>\n<thead><tr><th>Where</th><th>What</th><th>Paper</th><th>Here</th></tr></thead>\n\
         <tbody>\n",
        rows.len(),
        env!("CARGO_PKG_VERSION"),
    );
    for row in rows {
        let [place, what, paper, here, why] =
            [row.place, row.what, &row.paper, &row.here, row.why].map(escaped);
        let why = if why.is_empty() { why } else { format!("<div class=\"why\">{why}</div>") };
        let _ = writeln!(
            page,
            "<tr><th class=\"place\" scope=\"row\">{place}</th><td>{what}</td><td>{paper}</td><td>{here}{why}</td></tr>"
        );
        if let Some(svg) = &row.figure {
            let _ = writeln!(
                page,
                "<tr class=\"figure\"><td colspan=\"4\">{}</td></tr>",
                inline(svg, what.as_str())
            );
        }
    }
    page + "</tbody>\n</table>\n</body>\n</html>\n"
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Figure with the text colour of the page instead of black, and without its white background.
fn inline(svg: &str, label: &str) -> String {
    svg.replacen("fill=\"#FFFFFF\"", "fill=\"none\"", 1).replace("#000000", "currentColor").replacen(
        "<svg ",
        &format!("<svg role=\"img\" aria-label=\"{label}\" "),
        1,
    )
}
