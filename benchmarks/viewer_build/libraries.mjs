// What walk.js uses of three and Spark: nothing else gets into the bundle.
export {
  BackSide, Color, Mesh, NoColorSpace, PerspectiveCamera, Scene, ShaderMaterial, SphereGeometry, SRGBColorSpace,
  TextureLoader, WebGLRenderer,
} from "three";
export { SparkRenderer, SplatFileType, SplatMesh } from "@sparkjsdev/spark";
