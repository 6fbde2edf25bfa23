//! A program of the web client as browsers load it: the wasm file and its loader script.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, bail};
use wasm_bindgen_cli_support::Bindgen;

/// One program of the web client.
pub(crate) struct Bundle {
    /// Name of the program, such as `participant`, `lab` or `solver`.
    pub(crate) entry: &'static str,
    /// The script that wasm-bindgen generates. Its function `__wbg_get_imports()` returns the program's
    /// imports, which expect the program's exports in the variable `wasm`.
    pub(crate) js: String,
    /// The wasm program.
    pub(crate) wasm: Vec<u8>,
}

/// Runs wasm-bindgen on cargo's output.
///
/// # Errors
/// When the file is missing, was built with another version of wasm-bindgen, or needs additional JavaScript.
pub(crate) fn bundle(entry: &'static str, compiled: &Path) -> Result<Bundle> {
    let mut output = Bindgen::new()
        .input_path(compiled)
        .web(true)?
        .typescript(false)
        .remove_name_section(true)
        .remove_producers_section(true)
        .generate_output()
        .with_context(|| {
            format!(
                "wasm-bindgen cannot process {}: check that wasm-bindgen and \
                 wasm-bindgen-cli-support have the same version in Cargo.toml",
                compiled.display()
            )
        })?;
    // wasm-bindgen lists every crate that could have snippets, even if the crate has none.
    let with_snippets =
        output.snippets().iter().filter(|(_, scripts)| !scripts.is_empty()).map(|(name, _)| name);
    let extra: Vec<&String> = with_snippets
        .chain(output.local_modules().keys())
        .chain(output.npm_dependencies().keys())
        .collect();
    if !extra.is_empty() {
        bail!(
            "{entry} brings JavaScript of its own ({extra:?}), which the site does not carry: \
             use web-sys or js-sys instead, or drop the dependency that brings it"
        );
    }
    let mut names = Names::default();
    let mut js = output.js().to_owned();
    let module = output.wasm_mut();
    for import in module.imports.iter_mut() {
        import.name = names.short(&import.name);
    }
    for export in module.exports.iter_mut().filter(|export| export.name.len() > LONG) {
        export.name = names.short(&export.name);
    }
    js = shorter(&names.put_into(without_loader(&without_comments(&js))?));
    // Number the names in the order of the script, and sort the program's imports in the same order. The
    // names then compress to almost nothing.
    let mut names = Names::default();
    js.lines().filter_map(import_name).for_each(|name| drop(names.short(name)));
    let numbered = |name: &str| name[1..].parse::<usize>().unwrap_or(usize::MAX);
    let mut imports: Vec<_> = module
        .imports
        .iter()
        .map(|import| (import.module.clone(), names.short(&import.name), import.kind.clone()))
        .collect();
    imports.sort_by_key(|(_, name, _)| numbered(name));
    for (import, sorted) in module.imports.iter_mut().zip(imports) {
        (import.module, import.name, import.kind) = sorted;
    }
    js = names.put_into(&js);
    Ok(Bundle { entry, js, wasm: module.emit_wasm() })
}

/// Removes the loader at the end of wasm-bindgen's script. The loader supports several ways to call it and
/// servers that send no content type. Every participant would download this unused code.
///
/// # Errors
/// When the format of wasm-bindgen's script has changed.
fn without_loader(js: &str) -> Result<&str> {
    let is_whole = |calls: &&str| calls.contains("function __wbg_get_imports()");
    let calls = js.split_once("let wasmModule, wasmInstance, wasm;\n").map(|(calls, _)| calls);
    calls.filter(is_whole).context(
        "the script of wasm-bindgen does not end with its loader: see what changed in this version \
         and adapt xtask/src/site/bundle.rs",
    )
}

/// Maximum length of an export's name that is not shortened. Longer names contain a hash. Shorter
/// names can be used by other code.
const LONG: usize = 40;

/// Short names for the imports and exports between script and program. The names that wasm-bindgen generates
/// contain hashes, which do not compress, so a participant would download 5 KB of hashes.
#[derive(Default)]
struct Names(BTreeMap<String, String>);

impl Names {
    fn short(&mut self, name: &str) -> String {
        let next = format!("${}", self.0.len());
        self.0.entry(name.to_owned()).or_insert(next).clone()
    }

    /// Replaces the long names in the script by short ones.
    fn put_into(&self, js: &str) -> String {
        let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '$';
        let mut out = String::with_capacity(js.len());
        let mut rest = js;
        while let Some(start) = rest.find(is_part) {
            let (before, from) = rest.split_at(start);
            let end = from.find(|c| !is_part(c)).unwrap_or(from.len());
            let (word, after) = from.split_at(end);
            out.push_str(before);
            out.push_str(self.0.get(word).map_or(word, String::as_str));
            rest = after;
        }
        out + rest
    }
}

/// Removes documentation comments and indentation from a script.
fn without_comments(js: &str) -> String {
    let mut out = String::with_capacity(js.len());
    let mut is_inside = false;
    for line in js.lines().map(str::trim) {
        is_inside |= line.starts_with("/**");
        if !is_inside && !line.is_empty() {
            out.push_str(line);
            out.push('\n');
        }
        is_inside &= !line.ends_with("*/");
    }
    out
}

/// Replacements that remove spaces without changing the meaning of the code. No string literal in the script
/// contains these patterns.
const SPACES: [(&str, &str); 15] = [
    (" => ", "=>"),
    (" = ", "="),
    (" === ", "==="),
    (" !== ", "!=="),
    (" + ", "+"),
    (", true)", ",true)"),
    (", wasm.", ",wasm."),
    (" >>> ", ">>>"),
    (" ? ", "?"),
    (") {", "){"),
    (", arg", ",arg"),
    ("function (", "function("),
    ("{ return ", "{return "),
    ("},arguments); },", "},arguments);},"),
    ("if (", "if("),
];

/// Rewrites the script so that it compresses better. Imports become methods, similar imports become
/// neighbours, and a variable that is returned immediately is removed.
fn shorter(js: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in js.lines() {
        let line = SPACES
            .iter()
            .fold(line.to_owned(), |line, (with, without)| line.replace(with, without));
        let value = lines.last().and_then(|last| last.strip_prefix("const ret="));
        if let ("return ret;", Some(value)) = (line.as_str(), value) {
            let returned = format!("return {value}");
            lines.pop();
            lines.push(returned);
        } else {
            lines.push(match line.split_once(": function(") {
                Some((name, rest)) if name.starts_with('$') => format!("{name}({rest}"),
                _ => line,
            });
        }
    }
    let first = lines.iter().position(|line| line == "__proto__: null,").map_or(0, |at| at + 1);
    // Closures in imports also end with `};`, but only the import list is followed by `return import`.
    let end =
        lines.windows(2).position(|two| two[0] == "};" && two[1].starts_with("return import"));
    let (before, rest) = lines.split_at(first);
    let (listed, after) = rest.split_at(end.map_or(0, |end| end - first));
    let is_within = |_: &String, line: &String| import_name(line).is_none();
    let mut imports: Vec<&[String]> = listed.chunk_by(is_within).collect();
    imports.sort_by_key(|import| {
        let (_, call) = import[0].split_once('(').unwrap_or_default();
        (call.to_owned(), import[1..].to_vec())
    });
    [before, &imports.concat(), after].concat().join("\n") + "\n"
}

/// The name of the import that begins on this line, as `$12(` or `$12:`.
fn import_name(line: &str) -> Option<&str> {
    let (name, _) = line.split_once(['(', ':'])?;
    let number = name.strip_prefix('$')?;
    (!number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())).then_some(name)
}

impl Bundle {
    /// A page with the program inlined, because a page opened from a file cannot load other files. The
    /// program runs before the page counts as loaded.
    ///
    /// # Errors
    /// Never, because bytes can always be encoded as JSON.
    pub(crate) fn page(&self) -> serde_json::Result<String> {
        let bytes = serde_json::to_string(&self.wasm)?;
        let module = format!("new WebAssembly.Module(new Uint8Array({bytes}))");
        let script =
            self.started(&format!("new WebAssembly.Instance({module}, __wbg_get_imports())"));
        let script = format!("<script type=module>\n{script}</script>");
        Ok(format!(
            "<!doctype html>\n<head><meta charset=utf-8>\n{script}\n</head>\n<body></body>\n"
        ))
    }

    /// The script that loads the program from the file `wasm` in its own folder and starts it.
    ///
    /// The start call is in this script, because the site's content security policy forbids inline scripts.
    pub(super) fn script_for(&self, wasm: &str) -> String {
        let loaded = format!("fetch(new URL('{wasm}', import.meta.url))");
        let loading = format!("WebAssembly.instantiateStreaming({loaded}, __wbg_get_imports())");
        self.started(&format!("(await {loading}).instance"))
    }

    /// Returns the script that starts the program. `instance` is a JavaScript expression for its WebAssembly
    /// instance.
    fn started(&self, instance: &str) -> String {
        let calls = self.js.trim_end();
        format!("{calls}\nconst wasm = {instance}.exports;\nwasm.__wbindgen_start();\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bundle_with(js: &str) -> Bundle {
        Bundle { entry: "lab", js: js.into(), wasm: Vec::new() }
    }

    #[test]
    fn the_script_loads_the_hashed_file_and_starts() {
        let script = bundle_with("function __wbg_get_imports() {}\n\n").script_for("lab-12.wasm");
        let lines: Vec<&str> = script.lines().collect();
        assert_eq!(lines.len(), 3, "{script}");
        assert!(lines[1].contains("fetch(new URL('lab-12.wasm', import.meta.url))"), "{script}");
        assert_eq!(lines[2], "wasm.__wbindgen_start();");
    }

    #[test]
    fn names_are_short_and_comments_are_gone() {
        let mut names = Names::default();
        assert_eq!(names.short("__wbg_log_0123"), "$0");
        assert_eq!(names.short("__wbg_log_0123_1"), "$1");
        assert_eq!(names.short("__wbg_log_0123"), "$0");
        let js = "/**\n * Logs.\n */\n{\n  __wbg_log_0123: f, // why\n  x.__wbg_log_0123_1,\n}";
        let script = names.put_into(&without_comments(js));
        assert_eq!(script, "{\n$0: f, // why\nx.$1,\n}\n");
    }

    #[test]
    fn imports_are_methods_in_an_order_that_compresses() {
        let script = "function __wbg_get_imports() {
const import0 = {
__proto__: null,
$2: function(arg0) {
const ret = arg0.b;
return ret;
},
$3: function(arg0, arg1) {
var cb0 = (arg0, arg1) => {
if (arg0) {
arg1({ a: 1,
},
arg0);
}
};
return new Promise(cb0);
},
$1: function() { return handleError(function (arg0) {
arg0.c();
}, arguments); },
$0: function(arg0) {
const ret = arg0.a;
return ret;
},
};
return import0;
}
";
        let expected = "function __wbg_get_imports(){
const import0={
__proto__: null,
$1(){return handleError(function(arg0){
arg0.c();
},arguments);},
$0(arg0){
return arg0.a;
},
$2(arg0){
return arg0.b;
},
$3(arg0,arg1){
var cb0=(arg0,arg1)=>{
if(arg0){
arg1({ a: 1,
},
arg0);
}
};
return new Promise(cb0);
},
};
return import0;
}
";
        assert_eq!(shorter(script), expected);
    }

    #[test]
    fn a_page_from_a_file_has_all_in_it() {
        let bundle = Bundle { wasm: vec![0, 97], ..bundle_with("'<body>';\n") };
        let page = bundle.page().expect("a page");
        let start = "'<body>';\nconst wasm = new WebAssembly.Instance(new WebAssembly.Module(\
                     new Uint8Array([0,97])), __wbg_get_imports()).exports;";
        assert!(page.contains(start), "{page}");
    }

    #[test]
    fn the_loader_of_wasm_bindgen_goes_and_a_script_of_another_form_is_refused() {
        let calls = "function __wbg_get_imports() {}\n";
        let script =
            format!("{calls}let wasmModule, wasmInstance, wasm;\nfunction initSync() {{}}\n");
        assert_eq!(without_loader(&script).expect("the usual form"), calls);
        let error = without_loader(calls).expect_err("it has no loader");
        assert!(error.to_string().contains("loader"), "{error}");
    }
}
