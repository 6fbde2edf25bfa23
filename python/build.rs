//! Tells the linker that functions of Python are found when it loads the library.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
