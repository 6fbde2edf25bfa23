//! Draws solids with WebGL 2.

use super::listen::Listener;
use crate::runtime::Solid;
use js_sys::{Float32Array, Uint32Array};
use sidestep::value_view::Mesh;
use std::cell::Cell;
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use web_sys::{Document, HtmlCanvasElement, WebGl2RenderingContext as Gl, WebGlProgram, Window};

/// A painter for one canvas at a time. Browser objects are created once for each canvas.
#[derive(Default)]
pub(super) struct Painter(Option<Canvas>);

struct Canvas {
    element: HtmlCanvasElement,
    /// The WebGL 2 context. `None` if the browser does not support it.
    gl: Option<Gl>,
    /// Program and buffers on the GPU, once they are loaded.
    loaded: Option<Loaded>,
    /// Whether the context was lost after the last upload.
    is_lost: Rc<Cell<bool>>,
    _listeners: Vec<Listener>,
}

struct Loaded {
    program: WebGlProgram,
    /// The mesh in the buffers.
    mesh: Rc<Mesh>,
}

/// Number of frames timed for a new mesh.
const TIMED: usize = 3;

/// Supersampling factor in each direction while nothing moves.
const STILL: f64 = 2.0;

const VERTEX: &str = "#version 300 es
in vec3 place; in vec3 normal;
uniform mat4 matrix;
out vec3 facing; out float height;
void main() { gl_Position = matrix * vec4(place, 1.0); facing = normal; height = place.z; }";

/// Fragment shader. It uses the light and the tones of the library's drawing, and adds rings at
/// equal intervals of height.
const FRAGMENT: &str = "#version 300 es
precision highp float;
in vec3 facing; in float height;
uniform vec3 light; uniform vec3 tones[3]; uniform float ring;
out vec4 colour;
void main() {
  float lit = 2.0 * min(0.16 + 0.84 * max(dot(normalize(facing), light), 0.0), 1.0);
  vec3 tone = lit < 1.0 ? mix(tones[0], tones[1], lit) : mix(tones[1], tones[2], lit - 1.0);
  float turns = height / ring;
  // A horizontal face has no ring.
  float change = fwidth(turns);
  float away = change < 1e-4 ? 2.0 : abs(fract(turns + 0.5) - 0.5) / change;
  colour = vec4(mix(tones[0], tone, 0.4 + 0.6 * smoothstep(0.3, 1.1, away)), 1.0);
}";

impl Painter {
    /// Draws a solid. Returns `None` if the browser cannot draw it. Returns `Some(Some(ms))` with
    /// the time of a frame when it draws a mesh for the first time, and otherwise `Some(None)`.
    /// Calls `tell(false)` when the context is lost and `tell(true)` when it is restored.
    pub(super) fn draw<M>(
        &mut self,
        document: &Document,
        window: &Window,
        solid: &Solid<M>,
        tell: impl Fn(bool) + Clone + 'static,
    ) -> Option<Option<f64>> {
        let Some(element) = document.get_element_by_id(solid.canvas) else { return Some(None) };
        let element = element.dyn_into::<HtmlCanvasElement>().ok()?;
        if self.0.as_ref().is_none_or(|canvas| canvas.element != element) {
            self.0 = Some(Canvas::new(element, tell));
        }
        let canvas = self.0.as_mut()?;
        if canvas.gl.as_ref()?.is_context_lost() {
            // A listener notifies the page of a lost context.
            return Some(None);
        }
        if canvas.is_lost.take() {
            canvas.loaded = None;
        }
        let known = canvas.loaded.as_ref().map(|loaded| Rc::clone(&loaded.mesh));
        if known.is_some_and(|known| Rc::ptr_eq(&known, &solid.mesh)) {
            canvas.paint(window, solid, solid.is_still)?;
            return Some(None);
        }
        // The first frame uploads the mesh, so only later frames are timed. The shortest time
        // counts, because other work of the browser may slow some of the frames.
        canvas.paint(window, solid, false)?;
        canvas.wait();
        let clock = window.performance()?;
        let mut quickest = f64::INFINITY;
        for _ in 0..TIMED {
            let begin = clock.now();
            canvas.paint(window, solid, false)?;
            canvas.wait();
            quickest = quickest.min(clock.now() - begin);
        }
        canvas.paint(window, solid, solid.is_still)?;
        Some(Some(quickest))
    }
}

impl Canvas {
    fn new(element: HtmlCanvasElement, tell: impl Fn(bool) + Clone + 'static) -> Self {
        // Disable multisampling, which is slow on a CPU renderer. Supersampling smooths the edges
        // instead while nothing moves.
        let options = js_sys::Object::new();
        let _ = js_sys::Reflect::set(&options, &"antialias".into(), &false.into());
        let context = element.get_context_with_context_options("webgl2", &options).ok().flatten();
        let gl = context.and_then(|context| context.dyn_into::<Gl>().ok());
        let is_lost = Rc::new(Cell::new(false));
        let (lost, noted) = (tell.clone(), Rc::clone(&is_lost));
        let listeners = [
            Listener::new(&element, "webglcontextlost", move |event| {
                // Without this call, the browser would not restore the context.
                event.prevent_default();
                noted.set(true);
                lost(false);
            }),
            Listener::new(&element, "webglcontextrestored", move |_| tell(true)),
        ];
        let _listeners = listeners.into_iter().flatten().collect();
        Self { element, gl, loaded: None, is_lost, _listeners }
    }

    /// Waits until the GPU has finished.
    fn wait(&self) {
        if let Some(gl) = &self.gl {
            let mut pixel = [0; 4];
            let _ = gl.read_pixels_with_opt_u8_array(
                0,
                0,
                1,
                1,
                Gl::RGBA,
                Gl::UNSIGNED_BYTE,
                Some(&mut pixel),
            );
        }
    }

    fn paint<M>(&mut self, window: &Window, solid: &Solid<M>, is_still: bool) -> Option<()> {
        let gl = self.gl.as_ref()?;
        let known = self.loaded.take();
        let loaded = match known {
            Some(loaded) if Rc::ptr_eq(&loaded.mesh, &solid.mesh) => loaded,
            Some(loaded) => {
                fill(gl, &solid.mesh);
                Loaded { mesh: Rc::clone(&solid.mesh), ..loaded }
            }
            None => {
                let program = program(gl)?;
                begin(gl, &program)?;
                fill(gl, &solid.mesh);
                Loaded { program, mesh: Rc::clone(&solid.mesh) }
            }
        };
        let ratio = if is_still { STILL * window.device_pixel_ratio() } else { 1.0 };
        let size = [self.element.client_width(), self.element.client_height()];
        let [width, height] = size.map(|side| (f64::from(side) * ratio).round() as u32);
        if (self.element.width(), self.element.height()) != (width, height) {
            self.element.set_width(width);
            self.element.set_height(height);
        }
        gl.viewport(0, 0, width as i32, height as i32);
        gl.clear(Gl::COLOR_BUFFER_BIT | Gl::DEPTH_BUFFER_BIT);
        let place = |name: &str| gl.get_uniform_location(&loaded.program, name);
        let matrix = place("matrix");
        gl.uniform_matrix4fv_with_f32_array(matrix.as_ref(), false, &solid.matrix);
        gl.uniform3fv_with_f32_array(place("light").as_ref(), &solid.light);
        let tones: Vec<f32> =
            solid.tones.iter().flatten().map(|tone| f32::from(*tone) / 255.0).collect();
        gl.uniform3fv_with_f32_array(place("tones").as_ref(), &tones);
        gl.uniform1f(place("ring").as_ref(), solid.ring);
        let count = loaded.mesh.indices.len() as i32;
        gl.draw_elements_with_i32(Gl::TRIANGLES, count, Gl::UNSIGNED_INT, 0);
        self.loaded = Some(loaded);
        Some(())
    }
}

/// Compiles and links the shaders.
fn program(gl: &Gl) -> Option<WebGlProgram> {
    let program = gl.create_program()?;
    for (kind, code) in [(Gl::VERTEX_SHADER, VERTEX), (Gl::FRAGMENT_SHADER, FRAGMENT)] {
        let shader = gl.create_shader(kind)?;
        gl.shader_source(&shader, code);
        gl.compile_shader(&shader);
        gl.attach_shader(&program, &shader);
    }
    gl.link_program(&program);
    let is_linked = gl.get_program_parameter(&program, Gl::LINK_STATUS).is_truthy();
    is_linked.then_some(program)
}

/// Creates the buffers and declares their layout.
fn begin(gl: &Gl, program: &WebGlProgram) -> Option<()> {
    gl.use_program(Some(program));
    gl.bind_buffer(Gl::ARRAY_BUFFER, Some(&gl.create_buffer()?));
    gl.bind_buffer(Gl::ELEMENT_ARRAY_BUFFER, Some(&gl.create_buffer()?));
    let number = size_of::<f32>() as i32;
    for (name, first) in [("place", 0), ("normal", 3)] {
        let at = u32::try_from(gl.get_attrib_location(program, name)).ok()?;
        gl.enable_vertex_attrib_array(at);
        gl.vertex_attrib_pointer_with_i32(at, 3, Gl::FLOAT, false, 6 * number, first * number);
    }
    gl.enable(Gl::DEPTH_TEST);
    // The surface is closed, so faces that point away are always hidden.
    gl.enable(Gl::CULL_FACE);
    gl.clear_color(0.0, 0.0, 0.0, 0.0);
    Some(())
}

/// Uploads a mesh to the buffers.
fn fill(gl: &Gl, mesh: &Mesh) {
    let vertices = Float32Array::from(&mesh.vertices[..]);
    gl.buffer_data_with_array_buffer_view(Gl::ARRAY_BUFFER, &vertices, Gl::STATIC_DRAW);
    let indices = Uint32Array::from(&mesh.indices[..]);
    gl.buffer_data_with_array_buffer_view(Gl::ELEMENT_ARRAY_BUFFER, &indices, Gl::STATIC_DRAW);
}
