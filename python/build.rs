//! Tells the linker that Python's functions are resolved when Python loads the library.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
