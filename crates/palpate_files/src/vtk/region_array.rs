//! Names of arrays that contain the region of each cell.

/// Names of arrays of regions, without case and signs, the most specific one first. The crate's documentation lists them.
const NAMES: [&str; 24] = [
    "gmshphysical",
    "physical",
    "physicalid",
    "physicalids",
    "cellentityids",
    "region",
    "regions",
    "regionid",
    "regionids",
    "material",
    "materials",
    "materialid",
    "materialids",
    "mat",
    "matid",
    "tissue",
    "label",
    "labels",
    "labelid",
    "subdomain",
    "subdomains",
    "celltags",
    "attribute",
    "gmshgeometrical",
];

/// Rank of an array with the name `name`, 0 the first. `None` if it contains no regions.
pub(crate) fn rank(name: &str) -> Option<usize> {
    let name: String =
        name.chars().filter(|c| c.is_ascii_alphanumeric()).map(|c| c.to_ascii_lowercase()).collect();
    NAMES.iter().position(|known| *known == name)
}
