//! No two files of a crate import each other, directly or through others.
//!
//! An import is a name that one file takes from another: by `use`, or by a path in its code. A name that is re-exported counts as taken
//! from the file that defines it. `mod` lines and re-exports that a file does not use itself are no imports, and neither is test code.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syn::visit::Visit;

type ModulePath = Vec<String>;

/// What a module defines and where it is.
#[derive(Default)]
struct Module {
    file: PathBuf,
    defines: BTreeSet<String>,
    /// Names that the module brings into scope, with their paths.
    uses: BTreeMap<String, ModulePath>,
    globs: Vec<ModulePath>,
}

/// The modules of a crate.
#[derive(Default)]
struct Crate {
    modules: BTreeMap<ModulePath, Module>,
    files: Vec<(ModulePath, PathBuf, syn::File)>,
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let syn::Meta::List(list) = &attribute.meta else { return false };
        list.path.is_ident("cfg") && list.tokens.to_string() == "test"
    })
}

impl Crate {
    fn read(root: &Path) -> Self {
        let mut read = Self::default();
        read.add_file(Vec::new(), root);
        read
    }

    fn add_file(&mut self, path: ModulePath, file: &Path) {
        let text =
            std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let is_root = file.file_stem().is_some_and(|stem| stem == "lib" || stem == "main");
        let folder = file.parent().unwrap_or(Path::new(""));
        let folder =
            if is_root { folder.to_path_buf() } else { folder.join(file.file_stem().unwrap_or_default()) };
        self.add_items(&path, file, &folder, &parsed.items);
        self.files.push((path, file.to_path_buf(), parsed));
    }

    fn add_items(&mut self, path: &ModulePath, file: &Path, folder: &Path, items: &[syn::Item]) {
        let mut module = Module { file: file.to_path_buf(), ..Module::default() };
        for item in items {
            let name = match item {
                syn::Item::Fn(item) => &item.sig.ident,
                syn::Item::Struct(item) => &item.ident,
                syn::Item::Enum(item) => &item.ident,
                syn::Item::Union(item) => &item.ident,
                syn::Item::Trait(item) => &item.ident,
                syn::Item::Type(item) => &item.ident,
                syn::Item::Const(item) => &item.ident,
                syn::Item::Static(item) => &item.ident,
                syn::Item::Use(item) => {
                    uses_of(&item.tree, Vec::new(), &mut |name, target| match name {
                        Some(name) => drop(module.uses.insert(name, target)),
                        None => module.globs.push(target),
                    });
                    continue;
                }
                syn::Item::Mod(item) if !is_test(&item.attrs) => {
                    let child: ModulePath = path.iter().cloned().chain([item.ident.to_string()]).collect();
                    match &item.content {
                        Some((_, items)) => {
                            self.add_items(&child, file, &folder.join(item.ident.to_string()), items);
                        }
                        None => {
                            let file = folder.join(format!("{}.rs", item.ident));
                            self.add_file(child, &file);
                        }
                    }
                    continue;
                }
                _ => continue,
            };
            module.defines.insert(name.to_string());
        }
        self.modules.insert(path.clone(), module);
    }

    /// The file that defines what `target`, written in module `from`, names; `None` for what other crates define.
    fn file_of(&self, from: &ModulePath, target: &[String], depth: usize) -> Option<&Path> {
        let (first, rest) = target.split_first()?;
        if depth > 16 {
            return None;
        }
        match first.as_str() {
            "crate" => self.file_in(&Vec::new(), rest, depth),
            "self" => self.file_in(from, rest, depth),
            "super" => self.file_of_super(from, rest, depth),
            _ => self.file_in(from, target, depth),
        }
    }

    fn file_of_super(&self, from: &ModulePath, rest: &[String], depth: usize) -> Option<&Path> {
        let parent = from.split_last().map(|(_, parent)| parent.to_vec())?;
        match rest.split_first() {
            Some((next, rest)) if next == "super" => self.file_of_super(&parent, rest, depth),
            _ => self.file_in(&parent, rest, depth),
        }
    }

    fn file_in(&self, module: &ModulePath, rest: &[String], depth: usize) -> Option<&Path> {
        let found = self.modules.get(module)?;
        // A module alone names no item.
        let (name, deeper) = rest.split_first()?;
        if found.defines.contains(name) {
            return Some(&found.file);
        }
        let child: ModulePath = module.iter().cloned().chain([name.clone()]).collect();
        if self.modules.contains_key(&child) && !deeper.is_empty() {
            return self.file_in(&child, deeper, depth + 1);
        }
        if let Some(target) = found.uses.get(name) {
            let target: Vec<String> = target.iter().chain(deeper).cloned().collect();
            return self.file_of(module, &target, depth + 1);
        }
        found.globs.iter().find_map(|glob| {
            let target: Vec<String> = glob.iter().chain(rest).cloned().collect();
            self.file_of(module, &target, depth + 1)
        })
    }

    /// The files that each file imports from, each with a name that it takes.
    fn imports(&self) -> BTreeMap<&Path, BTreeMap<&Path, String>> {
        let mut imports = BTreeMap::<&Path, BTreeMap<&Path, String>>::new();
        for (module, file, parsed) in &self.files {
            let mut paths = Paths { module: module.clone(), found: Vec::new() };
            paths.visit_file(parsed);
            let to = imports.entry(file).or_default();
            for (from, path) in &paths.found {
                let defined = self.file_of(from, path, 0);
                if let Some(defined) = defined.filter(|defined| defined != file) {
                    to.entry(defined).or_insert_with(|| path.join("::"));
                }
            }
        }
        imports
    }
}

/// Calls `add` for every name that a `use` brings into scope, with its path; without a name for a glob.
fn uses_of(tree: &syn::UseTree, mut prefix: ModulePath, add: &mut impl FnMut(Option<String>, ModulePath)) {
    match tree {
        syn::UseTree::Path(path) => {
            prefix.push(path.ident.to_string());
            uses_of(&path.tree, prefix, add);
        }
        syn::UseTree::Name(name) if name.ident == "self" => add(prefix.last().cloned(), prefix),
        syn::UseTree::Name(name) => {
            prefix.push(name.ident.to_string());
            add(Some(name.ident.to_string()), prefix);
        }
        syn::UseTree::Rename(name) => {
            prefix.push(name.ident.to_string());
            add(Some(name.rename.to_string()), prefix);
        }
        syn::UseTree::Glob(_) => add(None, prefix),
        syn::UseTree::Group(group) => group.items.iter().for_each(|item| uses_of(item, prefix.clone(), add)),
    }
}

/// Collects the paths in the code of a file, without its tests; those in `use` lines count where the code uses them.
struct Paths {
    module: ModulePath,
    found: Vec<(ModulePath, ModulePath)>,
}

impl<'ast> Visit<'ast> for Paths {
    fn visit_item_use(&mut self, _: &'ast syn::ItemUse) {}

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if !is_test(&item.attrs) && item.content.is_some() {
            self.module.push(item.ident.to_string());
            syn::visit::visit_item_mod(self, item);
            self.module.pop();
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        self.found.push((self.module.clone(), names));
        syn::visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, called: &'ast syn::Macro) {
        // What stands in a macro is read as a list of expressions, if it is one.
        let arguments = syn::punctuated::Punctuated::<syn::Expr, syn::Token![,]>::parse_terminated;
        if let Ok(arguments) = called.parse_body_with(arguments) {
            for argument in &arguments {
                let mut inner = Self { module: self.module.clone(), found: Vec::new() };
                inner.visit_expr(argument);
                self.found.append(&mut inner.found);
            }
        }
    }
}

/// A circle of files, each of which imports the next and the last the first.
fn circle<'a>(imports: &BTreeMap<&'a Path, BTreeMap<&'a Path, String>>) -> Option<Vec<&'a Path>> {
    fn search<'a>(
        at: &'a Path,
        imports: &BTreeMap<&'a Path, BTreeMap<&'a Path, String>>,
        done: &mut BTreeSet<&'a Path>,
        way: &mut Vec<&'a Path>,
    ) -> Option<Vec<&'a Path>> {
        if let Some(begin) = way.iter().position(|file| *file == at) {
            return Some(way[begin..].to_vec());
        }
        if !done.insert(at) {
            return None;
        }
        way.push(at);
        let next = imports.get(at).into_iter().flat_map(BTreeMap::keys);
        let found = next.into_iter().find_map(|next| search(next, imports, done, way));
        way.pop();
        found
    }
    let mut done = BTreeSet::new();
    imports.keys().find_map(|file| search(file, imports, &mut done, &mut Vec::new()))
}

fn roots() -> Vec<PathBuf> {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../crates");
    let folders = std::fs::read_dir(crates).unwrap().map(|entry| entry.unwrap().path());
    let roots = folders.flat_map(|folder| ["src/lib.rs", "src/main.rs"].map(|root| folder.join(root)));
    let mut roots: Vec<PathBuf> = roots.filter(|root| root.exists()).collect();
    roots.sort();
    roots
}

#[test]
fn no_files_of_a_crate_import_each_other_in_a_circle() {
    let mut circles = Vec::new();
    for root in roots() {
        let read = Crate::read(&root);
        let imports = read.imports();
        if let Some(found) = circle(&imports) {
            let src = root.parent().unwrap();
            let name = |file: &Path| file.strip_prefix(src).unwrap_or(file).display().to_string();
            let next = found.iter().cycle().skip(1);
            let steps = found.iter().zip(next).map(|(from, to)| {
                format!("\n  {} takes {} from {}", name(from), imports[from][to], name(to))
            });
            circles.push(format!("{}:{}", src.display(), steps.collect::<String>()));
        }
    }
    assert!(circles.is_empty(), "files import each other in circles:\n{}", circles.join("\n"));
}

#[test]
fn a_circle_of_three_files_and_a_reexport_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("lib.rs", "mod a; mod b; mod c; pub use b::B; pub use c::C;");
    write("a.rs", "use crate::B; pub struct A(B);");
    write("b.rs", "pub struct B; pub fn b() -> crate::c::C { crate::c::C }");
    write("c.rs", "pub struct C; #[cfg(test)] mod tests { use crate::a::A; fn test(_: A) {} }");
    let is_circle = || circle(&Crate::read(&folder.path().join("lib.rs")).imports()).map(|found| found.len());
    assert_eq!(is_circle(), None);
    write("c.rs", "use super::a; pub struct C; pub fn c(_: a::A) {}");
    assert_eq!(is_circle(), Some(3));
}
