// What the page's code uses of three and Spark: nothing else gets into the bundle.
export {
  BackSide, BufferAttribute, BufferGeometry, Color, DataTexture, DoubleSide, Group, InstancedBufferGeometry, Line,
  LineBasicMaterial, LineLoop, Matrix4, Mesh, MeshBasicMaterial, NoColorSpace, PerspectiveCamera, Quaternion,
  RGBAIntegerFormat, RingGeometry, Scene, ShaderMaterial, SphereGeometry, SRGBColorSpace, TextureLoader,
  UnsignedIntType, Vector3, WebGLRenderer,
} from "three";
export { SparkRenderer, SplatFileType, SplatMesh } from "@sparkjsdev/spark";
