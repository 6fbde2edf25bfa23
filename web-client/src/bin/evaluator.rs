//! Entry point of the evaluator, which runs in a worker for the laboratory's explorer.

fn main() {
    sidestep_web::browser::evaluator::work();
}
