//! Entry point of the demonstration page.

use sidestep_web::pages::lab::{Demonstration, Lab};

fn main() {
    sidestep_web::browser::run(Lab::<Demonstration>::open);
}
