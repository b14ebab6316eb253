// A picture of plotly. A figure comes as text, since Vue watches each number of what a page holds, and only what somebody
// asked for is told. Where no graphics card draws a picture in space, it has 2.3 points for one of the screen: plotly's
// four take a processor twice as long, one leaves teeth where parts lie behind each other.
const HEARD = ["plotly_click", "plotly_selected", "plotly_hover", "plotly_unhover"];
const SOFT = /swiftshader|llvmpipe|software|basic render/i;

function dots() {
  const gl = document.createElement("canvas").getContext("webgl");
  const about = gl?.getExtension("WEBGL_debug_renderer_info");
  const soft = SOFT.test(gl?.getParameter(about ? about.UNMASKED_RENDERER_WEBGL : gl.RENDERER) ?? "");
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return soft ? 1.5 : 2;
}
let ratio;

export default {
  template: "<div></div>",
  props: { options: String },
  async mounted() {
    this.plotly = (await import("nicegui-plotly")).Plotly;
    this.update();
    this.observer = new ResizeObserver(() => this.drawn && this.$el.offsetWidth && this.plotly.Plots.resize(this.$el));
    this.observer.observe(this.$el);
  },
  unmounted() {
    this.observer?.disconnect();
    this.plotly?.purge(this.$el);
  },
  methods: {
    update() {
      if (!this.plotly || this.drawn === this.options) return; // mounting draws it
      const first = !this.drawn, figure = JSON.parse((this.drawn = this.options));
      ratio ??= dots();
      this.plotly.react(this.$el, figure.data, figure.layout, { ...figure.config, plotGlPixelRatio: ratio });
      if (first) HEARD.forEach((name) => this.$el.on(name, (event) => this.$emit(name, plain(event))));
    },
  },
};

function plain(event) {
  return { points: event?.points?.map((point) => ({ customdata: point.customdata })) };
}
