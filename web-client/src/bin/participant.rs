//! Program of the participant's page.

/// This allocator has a third of the default allocator's size, and is as fast for the work of this
/// page.
#[global_allocator]
static ALLOCATOR: rlsf::SmallGlobalTlsf = rlsf::SmallGlobalTlsf::new();

fn main() {
    sidestep_web::browser::run(sidestep_web::pages::participant::Participant::open);
}
