//! Entry of the evaluator: runs in a worker beside the laboratory's explorer.

fn main() {
    sidestep_web::browser::evaluator::work();
}
