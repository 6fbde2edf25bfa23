//! Entry of the laboratory.

fn main() {
    sidestep_web::browser::run(sidestep_web::pages::lab::Lab::open);
}
