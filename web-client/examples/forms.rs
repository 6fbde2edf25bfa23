//! A page with every kind of field and with rows that change places, for
//! `tests/tests/webassembly.rs`. It shows the content of the messages it received.

use sidestep::math::SeededRng;
use sidestep_web::form::{FieldValue, Form};
use sidestep_web::json;
use sidestep_web::runtime::{Command, Commands, NotKept, Page, PageContext};
use sidestep_web::view::{Node, el};

#[cfg(not(target_arch = "wasm32"))]
fn main() {
    let _ = Forms::open;
    eprintln!("this is a page: `cargo xtask test` builds and opens it");
}

#[cfg(target_arch = "wasm32")]
fn main() {
    let document = web_sys::window().and_then(|window| window.document()).expect("a document");
    let root = document.create_element("div").expect("an element");
    root.set_id("app");
    document.body().expect("a body").append_child(&root).expect("a place for the page");
    sidestep_web::browser::run(Forms::open);
}

/// The page.
struct Forms {
    said: String,
    rows: Vec<u32>,
}

/// The page's messages.
#[derive(Clone)]
enum Msg {
    Submitted(Form),
    Chosen(FieldValue),
    Rotate,
    Keep,
    Kept(Result<(), NotKept>),
    Woken(u32),
    Numbers,
}

impl Forms {
    fn open(_: PageContext) -> (Self, Commands<Msg>) {
        // Only the second of two timers with the same name fires.
        let wake = |n, after_ms| Command::Wake { timer: "wake", after_ms, message: Msg::Woken(n) };
        (Self { said: String::new(), rows: vec![1, 2, 3] }, vec![wake(1, 0.0), wake(2, 1.0)])
    }
}

impl Page for Forms {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        match message {
            Msg::Submitted(form) => self.said = format!("{form:?}"),
            Msg::Chosen(value) => self.said = format!("{value:?}"),
            Msg::Rotate => self.rows.rotate_left(1),
            Msg::Keep => {
                let (name, text) = ("sidestep.forms".to_owned(), "x".to_owned());
                return vec![Command::Keep { name, text, then: Box::new(Msg::Kept) }];
            }
            Msg::Kept(kept) => self.said = format!("{kept:?}"),
            Msg::Woken(n) => self.said = format!("woken {n}"),
            Msg::Numbers => self.said = format!("lost {:?}", lost_numbers()),
        }
        Vec::new()
    }

    fn view(&self) -> Node<Msg> {
        let input = |kind: &str, name: &str| {
            el("input").attr("type", kind).attr("name", name).test_id(name)
        };
        let option = |value: &str| el("option").attr("value", value).text(value);
        let select = |name: &str| {
            el("select").attr("name", name).test_id(name).children(["a", "b", "c"].map(option))
        };
        let radio = |value: &str| input("radio", "radio").attr("value", value).test_id(value);
        let form = el("form").test_id("form").on_submit(Msg::Submitted).children([
            input("text", "text").attr("value", "preset"),
            el("textarea").attr("name", "area").test_id("area"),
            input("number", "number").attr("step", "any"),
            input("number", "empty"),
            input("checkbox", "ticked").attr("checked", ""),
            input("checkbox", "unticked"),
            radio("left"),
            radio("right"),
            select("one"),
            input("text", "disabled").attr("disabled", ""),
            el("button").attr("type", "submit").test_id("submit").text("Submit"),
        ]);
        let row = |n: &u32| el("li").key(n).child(input("text", &format!("row-{n}")));
        let button = |name: &str, message: Msg| {
            el("button").attr("type", "button").test_id(name).on_press(message).text(name)
        };
        el("main")
            .child(form)
            .child(select("live").on_input(Msg::Chosen))
            .child(el("ul").test_id("rows").children(self.rows.iter().map(row)))
            .child(button("rotate", Msg::Rotate))
            .child(button("keep", Msg::Keep))
            .child(button("numbers", Msg::Numbers))
            .child(el("p").test_id("said").text(&self.said))
    }

    fn title(&self) -> String {
        "Forms".to_owned()
    }
}

/// Returns the numbers that change in a JSON round trip. There should be none.
fn lost_numbers() -> Vec<f64> {
    let mut rng = SeededRng::new(1);
    let random = (0..20_000).map(|_| f64::from_bits((rng.unit() * 1.8e19) as u64));
    let edges = [0.0, -0.0, 5e-324, f64::MAX, f64::MIN_POSITIVE, 0.1, 1e21, 123_456_789.0];
    let numbers = edges.into_iter().chain(random).filter(|x| x.is_finite());
    let again = |x: f64| json::read::<f64>(json::write(&x).as_bytes());
    numbers.filter(|&x| again(x).map(f64::to_bits) != Some(x.to_bits())).collect()
}
