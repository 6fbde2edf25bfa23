//! Entry point of the laboratory.

use sidestep_web::pages::lab::{Lab, Laboratory};

fn main() {
    sidestep_web::browser::run(Lab::<Laboratory>::open);
}
