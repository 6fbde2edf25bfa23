//! The files that the program reads and writes. A file appears whole or not at all.

pub mod atomic_file;
pub mod atomic_folder;
pub mod text;
pub mod csv_lines;
pub mod npz;
pub mod toml_lines;
pub mod field_tables;
pub mod study_toml;
pub mod trials_csv;
pub mod table;
pub mod tables;
pub mod exports;
pub mod features_csv;
